# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The values of honesty of an evaluation, summed over agents that agree in all groups.

As in :class:`~mtpgo_training.evaluation.scores.score_table.ScoreTable`, sums stand next to the
number of agents that they are over, so that averages over any groups are exact::

    average(totals(table.sums(), ["model", "motion"]))

Agents are computed many at a time, across instants: an instant has few, and numpy's overhead would
exceed the work.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mtpgo_core.quality.metrics import Array
from mtpgo_core.schema import AgentClass
from mtpgo_core.task import calibration
from mtpgo_training.evaluation.honesty.agent_honesty import PredictedPaths, Values, agent_honesty
from mtpgo_training.evaluation.honesty.consistency import LONGEST_CYCLE_S
from mtpgo_training.evaluation.scores.agent_scores import ScoredAgents
from mtpgo_training.evaluation.scores.score_table import (
    MOTIONS,
    SINCE_START_BANDS,
    motion_codes,
    since_start_codes,
)

HONESTY_GROUPS = (
    "model",
    "protocol",
    "recording",
    "site",
    "agent_class",
    "class_group",
    "motion",
    "speed",
    "manoeuvres",
    "since_start",
)
"""Columns by which the values are broken down."""

CLASS_GROUPS = {
    "unknown" if name == "any" else name: classes
    for name, classes in calibration.CLASS_GROUPS.items()
}
"""The classes that are calibrated together. Results of ``any`` are those of unknown road users and
of animals only, and are named ``unknown``."""

SPEED_EDGES_MPS = (1.0, 5.0, 15.0, 25.0)
"""Edges of the speed bands (m/s): creeping, walking and cycling, streets, roads, motorways;
chosen."""

SPEED_BANDS = ("0-1", "1-5", "5-15", "15-25", "25+", "unknown")
"""Names of the bands of the speed at the time of the prediction (m/s)."""

AT_ONCE = 512
"""Agents computed together; chosen, bounds the memory (5 MB with eight modes and 25 steps)."""

_CLASS_GROUP = {kind: name for name, kinds in CLASS_GROUPS.items() for kind in kinds}
_Series = tuple[str, str, str, str]
_Group = tuple[int, ...]
_JUMPS = ("jump", "mixture_jump")


@dataclass
class HonestyTable:
    """Collects predictions of several models, and sums up their values.

    Can be pickled, sent between processes and merged.
    """

    _waiting: dict[_Series, list[PredictedPaths]] = field(default_factory=dict)
    _past: dict[_Series, PredictedPaths] = field(default_factory=dict)
    _step_s: dict[_Series, float] = field(default_factory=dict)
    _sums: dict[tuple[_Series, _Group], Array] = field(default_factory=dict)
    _jumps: dict[tuple[_Series, _Group], list[Array]] = field(default_factory=dict)
    _names: list[str] = field(default_factory=list)

    def add(
        self, model: str, protocol: str, agents: ScoredAgents, predicted: PredictedPaths
    ) -> None:
        """Add the agents of one instant; instants of a recording come in the order of time.

        The number of modes may differ from instant to instant, as in a node that publishes fewer
        where there are many road users; the horizon may not.
        """
        if not len(predicted):
            return
        series = (model, protocol, agents.recording, agents.site)
        self._step_s.setdefault(series, agents.step_s)
        waiting = self._waiting.get(series)
        if waiting and waiting[0].weight.shape[1] != predicted.weight.shape[1]:
            self._compute(series)  # what is said of weights is relative to the number of modes
        waiting = self._waiting.setdefault(series, [])
        waiting.append(predicted)
        if sum(map(len, waiting)) >= AT_ONCE:
            self._compute(series)

    def finish(self) -> None:
        """Compute what waits, and forget the predictions."""
        for series in list(self._waiting):
            self._compute(series)
        self._past.clear()

    def merge(self, other: HonestyTable) -> None:
        """Take in the agents of another table."""
        self.finish()
        other.finish()
        for key, sums in other._sums.items():
            self._add_sums(key, sums, other._names)
        for key, parts in other._jumps.items():
            self._jumps.setdefault(key, []).extend(parts)

    def _compute(self, series: _Series) -> None:
        parts = self._waiting.pop(series, [])
        if not parts:
            return
        past = self._past.get(series)
        given = PredictedPaths.joined(parts)
        self._add(series, given, agent_honesty(given, self._step_s[series], past))
        whole = given if past is None else PredictedPaths.joined([past, given])
        recent = whole.stamp_ns >= whole.stamp_ns[-1] - round(1.01 * LONGEST_CYCLE_S * 1e9)
        self._past[series] = whole.select(recent)

    def _add(self, series: _Series, given: PredictedPaths, values: Values) -> None:
        table = np.stack(list(values.values()), axis=-1, dtype=np.float64)  # [n, columns]
        known = np.isfinite(table)
        both = np.stack([np.where(known, table, 0.0), known])  # [2, n, columns]
        jumps = np.stack([values[name] for name in _JUMPS], axis=-1).astype(np.float32)
        codes = np.stack(
            [
                given.agent_class.astype(np.int64),
                motion_codes(given.speed_mps),
                _speed_bands(given.speed_mps),
                given.manoeuvres.astype(np.int64),
                since_start_codes(given.since_start_s),
            ],
            axis=-1,
        )
        groups, place = np.unique(codes, axis=0, return_inverse=True)
        member = (place.reshape(-1) == np.arange(len(groups))[:, None]).astype(np.float64)
        sums = np.einsum("gn,snc->gsc", member, both, optimize=True)
        for i, code in enumerate(groups.tolist()):
            key = (series, tuple(code))
            self._add_sums(key, sums[i], list(values))
            rows = jumps[member[i] > 0]
            self._jumps.setdefault(key, []).append(rows[np.isfinite(rows[:, 0])])

    def _add_sums(self, key: tuple[_Series, _Group], sums: Array, names: list[str]) -> None:
        self._names = self._names or list(names)
        self._sums[key] = self._sums[key] + sums if key in self._sums else sums

    def sums(self) -> pd.DataFrame:
        """Return a row for each group.

        Index: :data:`HONESTY_GROUPS`. Columns: ``sum`` and ``count`` of the values of
        :func:`~mtpgo_training.evaluation.honesty.agent_honesty.agent_honesty`.
        """
        self.finish()
        both = np.stack(list(self._sums.values())) if self._sums else np.empty((0, 2, 0))
        parts = {
            name: pd.DataFrame(both[:, i], columns=self._names)
            for i, name in enumerate(("sum", "count"))
        }
        index = pd.MultiIndex.from_frame(_labels(list(self._sums)))
        return pd.concat(parts, axis=1).set_index(index)

    def jumps(self) -> pd.DataFrame:
        """Return a row for each agent with an earlier prediction: groups and jumps (m)."""
        self.finish()
        empty = np.empty((0, len(_JUMPS)), np.float32)
        rows = [np.concatenate([empty, *parts]) for parts in self._jumps.values()]
        labels = _labels(list(self._jumps)).astype("category")
        labels = labels.loc[np.repeat(np.arange(len(rows)), [len(part) for part in rows])]
        values = pd.DataFrame(np.concatenate([empty, *rows]), columns=list(_JUMPS))
        return pd.concat([labels.reset_index(drop=True), values], axis=1)


def _labels(keys: list[tuple[_Series, _Group]]) -> pd.DataFrame:
    classes = [kind.name.lower() for kind in AgentClass]
    rows = [
        (
            *series,
            classes[code[0]],
            _CLASS_GROUP[AgentClass(code[0])],
            MOTIONS[code[1]],
            SPEED_BANDS[code[2]],
            code[3],
            SINCE_START_BANDS[code[4]],
        )
        for series, code in keys
    ]
    return pd.DataFrame(rows, columns=list(HONESTY_GROUPS))


def _speed_bands(speed_mps: Array) -> NDArray[Any]:
    """[n] index in :data:`SPEED_BANDS`."""
    band = np.searchsorted(SPEED_EDGES_MPS, np.nan_to_num(speed_mps), side="right")
    return np.where(np.isfinite(speed_mps), band, len(SPEED_BANDS) - 1)
