# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions against what happened: collected agent by agent, averaged at the end.

Two protocols (design D15): ``centre``, the agent in the centre of each graph, and ``all``, every
agent once an instant. Each value is an average over the agents for which it is defined: ADE, APDE,
ANLL and the coverages over those with any observed future (and over their observed steps), FDE,
MR and FNLL over those observed at the last step.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mtpgo_training import metrics

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]

KEYS = (
    "ade",
    "fde",
    "mr",
    "apde",
    "anll",
    "fnll",
    "min_ade",
    "min_fde",
    "coverage_50",
    "coverage_90",
    "coverage_95",
)
"""Names of the values, as in the JSON; ``n`` agents and ``n_final`` beside them."""

PROTOCOLS = ("centre", "all")

_TITLES = {
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

Scores = dict[str, float]


def agent_scores(
    mean: Array, weight: Array, covariance: Array | None, truth: Array, mask: Mask
) -> dict[str, Array]:
    """Every metric of n agents, each [n]; those of the distribution NaN without ``covariance``.

    Args:
        mean: [n, M, H, 2] (m).
        weight: [n, M].
        covariance: [n, M, H, 2, 2] (m^2) or None.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
    """
    unknown = np.full(mean.shape[0], np.nan)
    values: dict[str, Array] = {
        "ade": metrics.ade(mean, weight, truth, mask),
        "fde": metrics.fde(mean, weight, truth, mask),
        "mr": metrics.miss_rate(mean, weight, truth, mask),
        "apde": metrics.apde(mean, weight, truth, mask),
        "min_ade": metrics.min_ade(mean, truth, mask),
        "min_fde": metrics.min_fde(mean, truth, mask),
    }
    if covariance is None:
        distribution = ("anll", "fnll", "coverage_50", "coverage_90", "coverage_95")
        return values | dict.fromkeys(distribution, unknown)
    values["anll"] = metrics.anll(mean, weight, covariance, truth, mask)
    values["fnll"] = metrics.fnll(mean, weight, covariance, truth, mask)
    for percent in (50, 90, 95):
        values[f"coverage_{percent}"] = metrics.coverage(
            mean, weight, covariance, truth, mask, percent / 100.0
        )
    return values


@dataclass
class ScoreBook:
    """Collects the scores of several models on the same agents."""

    _pages: dict[tuple[str, str], list[dict[str, Array]]] = field(default_factory=dict)

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
    ) -> None:
        """Score n agents, see :func:`agent_scores`."""
        if mean.shape[0]:
            values = agent_scores(mean, weight, covariance, truth, mask)
            self._pages.setdefault((model, protocol), []).append(values)

    def add_path(
        self,
        model: str,
        protocol: str,
        *,
        path: Array,
        truth: Array,
        mask: Mask,
        covariance: Array | None = None,
    ) -> None:
        """Score n agents with one path [n, H, 2] each, and covariance [n, H, 2, 2] if known."""
        self.add(
            model,
            protocol,
            mean=path[:, None],
            weight=np.ones((path.shape[0], 1)),
            covariance=None if covariance is None else covariance[:, None],
            truth=truth,
            mask=mask,
        )

    def table(self) -> ScoreTable:
        """The averages over all agents so far."""
        models: dict[str, dict[str, Scores]] = {}
        for (model, protocol), pages in self._pages.items():
            joined = {k: np.concatenate([page[k] for page in pages]) for k in KEYS}
            scores = {k: metrics.average(v) for k, v in joined.items()}
            scores["n"] = int(np.isfinite(joined["ade"]).sum())
            scores["n_final"] = int(np.isfinite(joined["fde"]).sum())
            models.setdefault(model, {})[protocol] = scores
        return ScoreTable(models)


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
        rows = [["", *_TITLES.values()]]
        for model, protocols in self.models.items():
            scores = protocols.get(protocol)
            if scores is not None:
                rows.append([model, *(_cell(k, scores[k]) for k in _TITLES)])
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
