# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of an evaluation as tidy tables, of which every average is a group-by.

One table of agents x horizon steps (25, with four float64 values) would take 2 GB for a model and
the three baselines on a million agents and instants, and a data set such as highD has ten times as
many. So there are two, and a third for the reliability diagram:

* :meth:`ScoreTable.agents`: a row for each model, protocol, recording, instant and agent, with the
  values of :data:`KEYS`;
* :meth:`ScoreTable.steps`: the values at each horizon step, summed over the agents that agree in
  all of :data:`GROUPS`;
* :meth:`ScoreTable.levels`: the shares of truths inside the ellipse of each level, summed over the
  same agents.

Sums stand next to the number of agents that they are over, so averages over any groups are exact::

    average(totals(table.agents(), ["model", "agent_class", "motion"]))
    average(totals(table.steps(), ["model", "site", "motion", "time_s"]))

Protocol ``centre`` has the agent in the centre of each graph, ``all`` every agent once an instant.
Each value is an average over the agents for which it is defined: ADE, APDE, ANLL and the coverages
over those with any observed future (and over their observed steps), FDE, MR and FNLL over those
observed at the last step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mtpgo_core.quality.metrics import (
    MOVING_COVERAGE_KEY,
    TIMES_S,
    Array,
    running_mean,
)
from mtpgo_core.schema import MOVING_MPS, AgentClass
from mtpgo_training.evaluation.scores.agent_scores import (
    KEYS,
    LEVELS,
    STEP_KEYS,
    AgentScores,
    ScoredAgents,
)
from mtpgo_training.scenes.kinematic_baselines import BASELINES

Averages = dict[str, dict[str, dict[str, float | None]]]
"""By model and protocol, the values of :data:`KEYS` (m, nats, shares) and of
:data:`HEADLINE_TIMES_S`, the number of agents ``n`` and of those observed at the last step
``n_final``; None where a value is not defined."""

HEADLINE_TIMES_S = {MOVING_COVERAGE_KEY.format(time_s): float(time_s) for time_s in TIMES_S}
"""The shares by which a model is judged: of moving agents in the heaviest mode's 90 % ellipse, by
name the time ahead (s). Over all times and agents, standing ones and the first steps hide the
rest."""

GROUPS = ("model", "protocol", "recording", "agent_class", "motion", "manoeuvres", "since_start")
"""Columns of all tables by which results are broken down; ``site`` follows from the recording."""

MOTIONS = ("standing", "moving", "unknown")
"""Motion of an agent at the time of the prediction; it moves above ``MOVING_MPS``."""

SINCE_START_EDGES_S = (20.0, 60.0, 120.0)
"""Edges of the bands of the time since the recording's start (s); chosen for trails: after 20 s
the first road users have crossed a site, after 60 s most ways have been taken, after 120 s the
lights have had a cycle or two."""

SINCE_START_BANDS = ("0-20", "20-60", "60-120", "120+", "unknown")
"""Names of these bands (s)."""

_NAMED = GROUPS[:3]
_CLASSES = [kind.name.lower() for kind in AgentClass]
_STEP_COLUMNS = ("ade", *STEP_KEYS)
_ROW = np.dtype(
    [
        *(("model", "u2"), ("protocol", "u1"), ("recording", "u2")),
        *(("agent_class", "u1"), ("motion", "u1"), ("manoeuvres", "u1"), ("since_start", "u1")),
        *(("stamp_ns", "i8"), ("track", "i4"), ("speed_mps", "f4")),
        *((key, "f4") for key in KEYS),
    ]
)
"""An agent in memory, 77 bytes."""


@dataclass(frozen=True)
class GroupSums:
    """Sums over the agents of one group, and over how many agents each of them is.

    Attributes:
        steps: [2, H, step columns].
        levels: [2, levels].
    """

    steps: Array
    levels: Array

    def __add__(self, other: GroupSums) -> GroupSums:
        horizon = max(self.steps.shape[1], other.steps.shape[1])
        steps = _lengthened(self.steps, horizon) + _lengthened(other.steps, horizon)
        return GroupSums(steps, self.levels + other.levels)


@dataclass
class ScoreTable:
    """Collects the scores of several models on the same agents.

    Can be pickled, sent between processes and merged. The values of an agent are kept as float32,
    sums as float64.
    """

    _names: dict[str, list[str]] = field(default_factory=lambda: {name: [] for name in _NAMED})
    _sites: dict[str, str] = field(default_factory=dict)
    _step_s: dict[str, float] = field(default_factory=dict)
    _rows: list[NDArray[Any]] = field(default_factory=list)
    _sums: dict[tuple[int, ...], GroupSums] = field(default_factory=dict)

    def __len__(self) -> int:
        return sum(len(rows) for rows in self._rows)

    @property
    def recordings(self) -> list[str]:
        """Names of the recordings, in the order in which they came."""
        return list(self._names["recording"])

    def add(
        self, model: str, protocol: str, scores: AgentScores, agents: ScoredAgents | None = None
    ) -> None:
        """Add n agents.

        Args:
            model: its name.
            protocol: ``all`` or ``centre``.
            scores: of the agents.
            agents: who they are; not known by default.
        """
        n = len(scores.mask)
        if not n:
            return
        agents = ScoredAgents.unknown(n) if agents is None else agents
        self._sites.setdefault(agents.recording, agents.site)
        if np.isfinite(agents.step_s):
            self._step_s.setdefault(model, agents.step_s)
        names = zip(_NAMED, (model, protocol, agents.recording), strict=True)
        named = {column: self._code(column, name) for column, name in names}
        columns: dict[str, Any] = named | {
            "agent_class": agents.agent_class,
            "motion": motion_codes(agents.speed_mps),
            "manoeuvres": agents.manoeuvres,
            "since_start": since_start_codes(np.full(n, agents.since_start_s)),
            "stamp_ns": agents.stamp_ns,
            "track": agents.track,
            "speed_mps": agents.speed_mps,
        }
        rows = np.empty(n, dtype=_ROW)
        for column, values in (columns | scores.values).items():
            rows[column] = values
        for key in KEYS:
            rows[key][~np.isfinite(rows[key])] = np.nan
        self._rows.append(rows)
        self._add_sums(rows, scores)

    def _code(self, column: str, name: str) -> int:
        names = self._names[column]
        if name not in names:
            names.append(name)
        return names.index(name)

    def _add_sums(self, rows: NDArray[Any], scores: AgentScores) -> None:
        """Add the values at the steps and levels to the sums of the agents' groups."""
        observed = [scores.steps[key] for key in STEP_KEYS]
        running = running_mean(scores.steps["displacement"], scores.mask)
        steps = np.stack([running, *observed], axis=-1, dtype=np.float64)  # [n, H, columns]
        known = np.isfinite(steps)
        known[..., 1:] &= scores.mask[..., None]
        steps = np.stack([np.where(known, steps, 0.0), known])
        known = np.isfinite(scores.inside)
        levels = np.stack([np.where(known, scores.inside, 0.0), known])
        groups = rows[list(GROUPS)].tolist()
        distinct = {group: i for i, group in enumerate(dict.fromkeys(groups))}
        member = np.zeros((len(distinct), len(groups)))  # [groups, n]
        member[[distinct[group] for group in groups], np.arange(len(groups))] = 1.0
        step_sums = np.tensordot(member, steps, axes=(1, 1))  # [groups, 2, H, columns]
        level_sums = np.tensordot(member, levels, axes=(1, 1))
        for group, own_steps, own_levels in zip(distinct, step_sums, level_sums, strict=True):
            self._add_group(group, GroupSums(own_steps, own_levels))

    def _add_group(self, group: tuple[int, ...], sums: GroupSums) -> None:
        self._sums[group] = self._sums[group] + sums if group in self._sums else sums

    def merge(self, other: ScoreTable) -> None:
        """Take in the agents of another table."""
        self._sites = other._sites | self._sites
        self._step_s = other._step_s | self._step_s
        codes = {
            column: np.array([self._code(column, name) for name in names], dtype=np.int64)
            for column, names in other._names.items()
        }
        rows = other._joined()
        own = rows.copy()
        for column in _NAMED:
            own[column] = codes[column][rows[column]]
        self._rows.append(own)
        for group, sums in other._sums.items():
            named = (int(codes[c][code]) for c, code in zip(_NAMED, group, strict=False))
            self._add_group((*named, *group[len(_NAMED) :]), sums)

    def _joined(self) -> NDArray[Any]:
        """Return the rows of all agents in one array, which replaces those of each instant."""
        if len(self._rows) != 1:
            self._rows = [np.concatenate(self._rows) if self._rows else np.empty(0, dtype=_ROW)]
        return self._rows[0]

    def agents(self) -> pd.DataFrame:
        """Return a row for each scored agent.

        Columns: :data:`GROUPS` (``manoeuvres`` as bits) and ``site``; ``stamp_ns`` (ns) and
        ``track`` (index in the recording); ``speed_mps`` then (m/s); :data:`KEYS`.
        """
        rows = self._joined()
        groups = self._labels({column: rows[column] for column in GROUPS})
        others = [column for column in _ROW.names or () if column not in GROUPS]
        return pd.concat([groups, pd.DataFrame({c: rows[c] for c in others})], axis=1)

    def steps(self) -> pd.DataFrame:
        """Return sums over agents, a row for each group and horizon step.

        Index: :data:`GROUPS`, ``site``, ``step`` (from 1) and ``time_s`` (NaN if not known).
        Columns: ``sum`` and ``count`` of :data:`STEP_KEYS` and of ``ade``, the ADE (m) of a
        horizon that ends at the step.
        """
        blocks = [sums.steps for sums in self._sums.values()]
        step = [np.arange(1, block.shape[1] + 1) for block in blocks]
        labels, sums = self._grouped(blocks, _STEP_COLUMNS)
        labels["step"] = np.concatenate([np.empty(0, np.int64), *step])
        step_s = labels["model"].astype(str).map(self._step_s).astype(np.float64)
        labels["time_s"] = (step_s * labels["step"]).round(6)
        return sums.set_index(pd.MultiIndex.from_frame(labels))

    def horizons(self) -> dict[str, float]:
        """Return the last time ahead of each model and baseline (s), NaN if it is not known."""
        index = self.steps().index
        times = pd.Series(index.get_level_values("time_s"))
        found = times.groupby(index.get_level_values("model").astype(str)).max()
        return {str(model): float(time_s) for model, time_s in found.items()}

    def levels(self) -> pd.DataFrame:
        """Return sums over agents, a row for each group and level of :data:`LEVELS`.

        Index: :data:`GROUPS`, ``site`` and ``level``. Columns: ``sum`` and ``count`` of
        ``inside``, the share of an agent's observed steps inside the ellipse of the level.
        """
        blocks = [sums.levels[..., None] for sums in self._sums.values()]
        labels, sums = self._grouped(blocks, ("inside",))
        labels["level"] = np.tile(LEVELS, len(blocks))
        return sums.set_index(pd.MultiIndex.from_frame(labels))

    def _grouped(
        self, blocks: Sequence[Array], columns: Sequence[str]
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Return the labels and the sums of all groups, whose sums are [2, rows, columns]."""
        both = np.concatenate([np.empty((2, 0, len(columns))), *blocks], axis=1)
        codes = np.array(list(self._sums), dtype=np.int64).reshape(-1, len(GROUPS))
        codes = codes.repeat([block.shape[1] for block in blocks], axis=0)
        labels = self._labels({name: codes[:, i] for i, name in enumerate(GROUPS)})
        parts = {
            name: pd.DataFrame(part, columns=list(columns))
            for name, part in zip(("sum", "count"), both, strict=True)
        }
        return labels, pd.concat(parts, axis=1)

    def _labels(self, codes: Mapping[str, NDArray[Any]]) -> pd.DataFrame:
        """Return names in the place of codes, as categoricals; the baselines after the models."""
        models = self._names["model"]
        order = sorted(models, key=lambda name: name in BASELINES)
        labels = {
            "model": _categories(codes["model"], models).reorder_categories(order),
            "protocol": _categories(codes["protocol"], self._names["protocol"]),
            "recording": _categories(codes["recording"], self._names["recording"]),
            "agent_class": _categories(codes["agent_class"], _CLASSES),
            "motion": _categories(codes["motion"], MOTIONS),
            "manoeuvres": codes["manoeuvres"].astype(np.uint8),
            "since_start": _categories(codes["since_start"], SINCE_START_BANDS),
        }
        sites = [self._sites[name] for name in self._names["recording"]]
        names = list(dict.fromkeys(sites))
        place = np.array([names.index(site) for site in sites], dtype=np.int64)
        labels["site"] = _categories(place[codes["recording"]], names)
        return pd.DataFrame(labels)

    def averages(self) -> Averages:
        """Return the averages over all agents, the baselines after the models."""
        found: Averages = {}
        for (model, protocol), scores in scores_by(self.agents(), ["model", "protocol"]).items():
            found.setdefault(model, {})[protocol] = scores | dict.fromkeys(HEADLINE_TIMES_S)
        headline = average(self.headline_totals(["model", "protocol"]))
        for (model, protocol), values in headline.to_dict("index").items():
            found[model][protocol] |= {key: none(value) for key, value in values.items()}
        return found

    def headline_totals(self, by: Sequence[str]) -> pd.DataFrame:
        """Return sums and numbers of agents of :data:`HEADLINE_TIMES_S`, as :func:`totals` does.

        Args:
            by: names of index levels of :meth:`steps`.
        """
        steps = self.steps()
        moving = steps.index.get_level_values("motion") == "moving"
        time_s = steps.index.get_level_values("time_s").to_numpy()
        columns: dict[tuple[str, str], pd.Series] = {}
        for key, at_s in HEADLINE_TIMES_S.items():
            total = totals(steps[moving & np.isclose(time_s, at_s)], by)
            columns |= {(part, key): total[part, "coverage_90"] for part in ("sum", "count")}
        return pd.DataFrame(columns).fillna(0.0)


def totals(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Return sums and numbers of agents of any groups, with columns as of ``ScoreTable.steps``.

    Args:
        table: one of the three of a :class:`ScoreTable`, or some of its rows.
        by: names of its columns or index levels.
    """
    if isinstance(table.columns, pd.MultiIndex):
        return table.groupby(list(by), observed=True, dropna=False).sum()
    groups = table.groupby(list(by), observed=True)
    index = groups.size().index
    place = groups.ngroup().fillna(-1).to_numpy(np.int64)  # -1 without a group
    sums, counts = {}, {}
    for key in KEYS:  # one by one: as float64 all of them would be as large as the table
        values = table[key].to_numpy(np.float64)
        known = np.isfinite(values) & (place >= 0)
        counts[key] = np.bincount(place[known], minlength=len(index))
        sums[key] = np.bincount(place[known], values[known], minlength=len(index))
    parts = {"sum": pd.DataFrame(sums, index), "count": pd.DataFrame(counts, index)}
    return pd.concat(parts, axis=1)


def average(total: pd.DataFrame) -> pd.DataFrame:
    """Return the averages of :func:`totals`, NaN where no agent counts."""
    return total["sum"] / total["count"]


def scores_by(agents: pd.DataFrame, by: Sequence[str]) -> dict[Any, dict[str, float | None]]:
    """Return the values of :data:`Averages` of each group of agents.

    Args:
        agents: rows of :meth:`ScoreTable.agents`.
        by: columns.
    """
    total = totals(agents, by)
    counts = total["count"][["ade", "fde"]].to_dict("index")
    return {
        group: {key: none(value) for key, value in row.items()}
        | {"n": int(counts[group]["ade"]), "n_final": int(counts[group]["fde"])}
        for group, row in average(total).to_dict("index").items()
    }


def none(value: float) -> float | None:
    """Return the value, or None for NaN, which JSON does not have."""
    return None if np.isnan(value) else float(value)


def _categories(codes: NDArray[Any], names: Sequence[str]) -> pd.Categorical:
    return pd.Categorical.from_codes(codes, categories=list(names))


def motion_codes(speed_mps: Array) -> NDArray[np.int64]:
    """[n] index in :data:`MOTIONS`."""
    known = np.isfinite(speed_mps)
    return np.where(known, np.nan_to_num(speed_mps) > MOVING_MPS, MOTIONS.index("unknown"))


def since_start_codes(since_start_s: Array) -> NDArray[np.int64]:
    """[n] index in :data:`SINCE_START_BANDS`."""
    band = np.searchsorted(SINCE_START_EDGES_S, np.nan_to_num(since_start_s), side="right")
    return np.where(np.isfinite(since_start_s), band, SINCE_START_BANDS.index("unknown"))


def _lengthened(sums: Array, horizon: int) -> Array:
    """[2, horizon, columns] sums, zero at the steps that they lack."""
    return np.pad(sums, ((0, 0), (0, horizon - sums.shape[1]), (0, 0)))
