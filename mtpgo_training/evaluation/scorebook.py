# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions against what happened: collected agent by agent, averaged at the end.

Two protocols (design D15): ``centre``, the agent in the centre of each graph, and ``all``, every
agent once an instant. Each value is an average over the agents for which it is defined: ADE, APDE,
ANLL and the coverages over those with any observed future (and over their observed steps), FDE,
MR and FNLL over those observed at the last step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mtpgo_training.evaluation import metrics
from mtpgo_training.evaluation.metrics import Array, Mask
from mtpgo_training.evaluation.scorepage import KEYS, AgentScores, Page, score_agents
from mtpgo_training.scenes.kinematic_baselines import BASELINES

__all__ = ["KEYS", "PROTOCOLS", "TITLES", "ScoreBook", "ScoreTable", "Scores"]

PROTOCOLS = ("centre", "all")

TITLES = {
    "ade": "ADE m",
    "fde": "FDE m",
    "mr": "MR",
    "apde": "APDE m",
    "anll": "ANLL",
    "fnll": "FNLL",
    "min_ade": "minADE m",
    "min_fde": "minFDE m",
    "coverage_50": "in 50%",
    "coverage_90": "in 90%",
    "coverage_95": "in 95%",
    "n": "agents",
}
"""Heads of the columns of a table."""

Scores = dict[str, float]


@dataclass
class ScoreBook:
    """Collects the scores of several models on the same agents, recording by recording.

    Attributes:
        pages: by model, protocol and recording, in the order in which they came.
        step_s: time between two horizon steps (s), NaN where nobody told.
    """

    pages: dict[tuple[str, str, str], Page] = field(default_factory=dict)
    step_s: float = float("nan")

    def add(
        self,
        model: str,
        protocol: str,
        *,
        mean: Array,
        weight: Array,
        covariance: Array | None,
        truth: Array,
        mask: Mask,
        recording: str = "",
        agent_class: NDArray[np.uint8] | None = None,
        manoeuvres: NDArray[np.uint8] | None = None,
    ) -> AgentScores:
        """Score n agents.

        Args:
            model: its name.
            protocol: one of :data:`PROTOCOLS`.
            mean: [n, M, H, 2] (m).
            weight: [n, M].
            covariance: [n, M, H, 2, 2] (m^2), None where the model has none.
            truth: [n, H, 2] (m).
            mask: [n, H] observed.
            recording: name of the recording.
            agent_class: [n], default unknown.
            manoeuvres: [n] from :func:`mtpgo_training.data.manoeuvres.label`, default none.

        Returns:
            The scores that were added.
        """
        scores = score_agents(mean, weight, covariance, truth, mask)
        n = mean.shape[0]
        if n:
            nothing = np.zeros(n, dtype=np.uint8)
            self.pages.setdefault((model, protocol, recording), Page()).add(
                scores,
                nothing if agent_class is None else agent_class,
                nothing if manoeuvres is None else manoeuvres,
            )
        return scores

    def add_path(
        self,
        model: str,
        protocol: str,
        *,
        path: Array,
        truth: Array,
        mask: Mask,
        covariance: Array | None = None,
        recording: str = "",
        agent_class: NDArray[np.uint8] | None = None,
        manoeuvres: NDArray[np.uint8] | None = None,
    ) -> AgentScores:
        """Like :meth:`add`, with one path [n, H, 2] each, and covariance [n, H, 2, 2] if known."""
        return self.add(
            model,
            protocol,
            mean=path[:, None],
            weight=np.ones((path.shape[0], 1)),
            covariance=None if covariance is None else covariance[:, None],
            truth=truth,
            mask=mask,
            recording=recording,
            agent_class=agent_class,
            manoeuvres=manoeuvres,
        )

    def merge(self, other: ScoreBook) -> None:
        """Take the agents of another book in; books can be pickled and sent between processes."""
        for key, page in other.pages.items():
            self.pages.setdefault(key, Page()).merge(page)
        if np.isnan(self.step_s):
            self.step_s = other.step_s

    @property
    def recordings(self) -> list[str]:
        """Names of the recordings, in the order in which they came."""
        return list(dict.fromkeys(recording for _, _, recording in self.pages))

    def series(self) -> dict[tuple[str, str], dict[str, Page]]:
        """By model and protocol, the pages by recording."""
        found: dict[tuple[str, str], dict[str, Page]] = {}
        for (model, protocol, recording), page in self.pages.items():
            found.setdefault((model, protocol), {})[recording] = page
        return found

    def table(self) -> ScoreTable:
        """The averages over all agents so far, the baselines after the models."""
        models: dict[str, dict[str, Scores]] = {}
        for (model, protocol), pages in self.series().items():
            models.setdefault(model, {})[protocol] = averages(list(pages.values()))
        return ScoreTable(dict(sorted(models.items(), key=lambda item: item[0] in BASELINES)))


def averages(pages: Sequence[Page], chosen: Sequence[NDArray[np.bool_]] | None = None) -> Scores:
    """The values of :data:`KEYS` over the agents of some pages, ``n`` and ``n_final``.

    Args:
        pages: of one model and protocol.
        chosen: for each page, [agents] which of them count; all by default.
    """
    rows = {}
    for key in KEYS:
        values = [page.values(key).astype(np.float64) for page in pages]
        if chosen is not None:
            values = [v[some] for v, some in zip(values, chosen, strict=True)]
        rows[key] = np.concatenate(values)
    scores: Scores = {key: metrics.average(values) for key, values in rows.items()}
    scores["n"] = int(np.isfinite(rows["ade"]).sum())
    scores["n_final"] = int(np.isfinite(rows["fde"]).sum())
    return scores


@dataclass(frozen=True)
class ScoreTable:
    """Average scores.

    Attributes:
        models: by name of the model and protocol, the values of :data:`KEYS` (m and nats) and the
            number of agents ``n`` and of those observed at the last step ``n_final``.
    """

    models: dict[str, dict[str, Scores]]

    def to_dict(self) -> dict[str, dict[str, dict[str, float | None]]]:
        """Plain data for JSON, with None for what is not defined."""
        return {
            model: {
                protocol: {k: None if np.isnan(v) else v for k, v in scores.items()}
                for protocol, scores in protocols.items()
            }
            for model, protocols in self.models.items()
        }

    def text(self, protocol: str = "all") -> str:
        """A table for the terminal, one model a line."""
        rows = [["", *TITLES.values()]]
        for model, protocols in self.models.items():
            scores = protocols.get(protocol)
            if scores is not None:
                rows.append([model, *(_cell(k, scores[k]) for k in TITLES)])
        return columns(rows)


def columns(rows: list[list[str]]) -> str:
    """Rows of cells as text, the first column to the left, the others to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )


def _cell(key: str, value: float) -> str:
    if key == "n":
        return str(int(value))
    return "-" if np.isnan(value) else f"{value:.3f}"
