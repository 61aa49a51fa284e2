# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores on a site by class, motion and manoeuvre, and their averages over sites."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.schema import BoolArray
from mtpgo_training.data.manoeuvres import MANOEUVRES, members
from mtpgo_training.evaluation.honesty.honesty_summary import honesty_values
from mtpgo_training.evaluation.honesty.honesty_table import CLASS_GROUPS, HonestyTable
from mtpgo_training.evaluation.honesty.simple_comparison import SIMPLE, is_worse
from mtpgo_training.evaluation.scores.score_summary import since_start_groups
from mtpgo_training.evaluation.scores.score_table import ScoreTable, average, none, totals

Json = dict[str, Any]

MODEL = "model"
"""Name of a fold's model in the scores."""

VALUES = ("ade", "fde", "min_ade", "min_fde", "mr", "anll", "coverage_90")
"""Averages over agents that are given for each group, see
:data:`mtpgo_training.evaluation.scores.agent_scores.KEYS`."""

HONESTY_VALUES = (
    "heaviest_nearest",
    "chance",
    "brier",
    "brier_min_fde",
    "weight_near_heaviest",
    "mode_distance",
    "jump",
    "mixture_jump",
    "reverses",
    "creep",
    "creeps",
    "lateral_8",
    "overlaps",
)
"""Values of honesty and plausibility, see
:func:`mtpgo_training.evaluation.honesty.honesty_summary.honesty_values`."""

LEAST_AGENTS = 50
"""A site counts in the average over sites where it has this many agents and instants of a group;
chosen: fewer are a few seconds of a few road users."""


def group_scores(table: ScoreTable, honesty: HonestyTable) -> dict[str, Json]:
    """Return the scores of a site by group of agents; None where a value is not defined.

    Groups: ``all``, ``moving`` and ``standing``; ``CLASS MOTION`` for each of the class groups;
    each manoeuvre; those of ``SINCE_START_GROUPS``. Values: ``n`` agents and instants; those of
    :data:`VALUES`; ``ade_cv`` and ``ade_ca``, the ADE of the baselines (m), and ``ratio_cv`` and
    ``ratio_ca`` relative to them; ``coverage_90_at``, the coverage at each of ``TIMES_S``;
    those of :data:`HONESTY_VALUES`, ``jump_cv`` (m), and by time ``region_90_at`` (coverage of the
    mixture), ``sigma_to_rmse_at`` and ``nll_at``.

    Args:
        table: with the scores of :data:`MODEL` and of the baselines by the protocol ``all``.
        honesty: of the same agents.
    """
    agents = table.agents()
    agents = agents[agents["protocol"] == "all"]
    steps = table.steps()
    labels = steps.index.to_frame(index=False)
    wanted = ((labels["protocol"] == "all") & (labels["model"] == MODEL)).to_numpy()
    steps, labels = steps[wanted], labels[wanted]
    chosen, chosen_steps = _selections(agents), _selections(labels)
    found = {
        group: _scores(agents[rows], steps[chosen_steps[group]])
        for group, rows in chosen.items()
        if rows.any()
    }
    sums, jumps = honesty.sums(), honesty.jumps()
    chosen_sums, chosen_jumps = _selections(sums.index.to_frame(index=False)), _selections(jumps)
    for group, row in found.items():
        row |= _honesty(sums[chosen_sums[group]], jumps[chosen_jumps[group]])
    return found


def _selections(labels: pd.DataFrame) -> dict[str, BoolArray]:
    """Return which rows belong to each group.

    Args:
        labels: with the columns ``agent_class``, ``motion``, ``manoeuvres`` and ``since_start``.
    """
    motion = labels["motion"].astype(str).to_numpy()
    kind = labels["agent_class"].astype(str).to_numpy()
    chosen: dict[str, BoolArray] = {"all": np.ones(len(labels), dtype=np.bool_)}
    for name in ("moving", "standing"):
        chosen[name] = motion == name
    for group, classes in CLASS_GROUPS.items():
        own = np.isin(kind, [member.name.lower() for member in classes])
        for name in ("moving", "standing"):
            chosen[f"{group} {name}"] = own & (motion == name)
    bits = labels["manoeuvres"].to_numpy()
    chosen |= {name: members(bits, name) for name in MANOEUVRES if name not in chosen}
    return chosen | since_start_groups(labels)


def _scores(agents: pd.DataFrame, steps: pd.DataFrame) -> Json:
    total = totals(agents, ["model"])
    means, counts = average(total), total["count"]
    found: Json = {"n": 0} | dict.fromkeys(VALUES)
    if MODEL in means.index:
        found["n"] = int(counts.at[MODEL, "ade"])
        found |= {key: none(means.at[MODEL, key]) for key in VALUES}
    for name in SIMPLE:
        other = none(means.at[name, "ade"]) if name in means.index else None
        found[f"ade_{name}"] = other
        found[f"ratio_{name}"] = found["ade"] / other if found["ade"] and other else None
    found["coverage_90_at"] = _coverage(steps)
    return found


def _honesty(sums: pd.DataFrame, jumps: pd.DataFrame) -> Json:
    """Return the values of :data:`HONESTY_VALUES` and by time, from rows of a honesty table."""
    values = honesty_values(sums, jumps, ["model"])
    own = values.get((MODEL,))
    if own is None:
        times: Json = {f"{time:g}": None for time in TIMES_S}
        by_time = dict.fromkeys(("region_90_at", "sigma_to_rmse_at", "nll_at"), times)
        return dict.fromkeys((*HONESTY_VALUES, "jump_cv")) | by_time
    flat = own["weights"] | own["diversity"] | own["consistency"] | own["feasibility"]
    found: Json = {name: flat[name] for name in HONESTY_VALUES}
    found["jump_cv"] = values.get(("cv",), {}).get("consistency", {}).get("jump")
    found["region_90_at"] = _at(own["time_s"], own["region_90"])
    found["nll_at"] = _at(own["time_s"], own["nll"])
    found["sigma_to_rmse_at"] = _at(own["spread"]["time_s"], own["spread"]["ratio"])
    return found


def _at(times_s: Sequence[float], values: Sequence[float | None]) -> Json:
    """Return the values at ``TIMES_S``, by the time as text."""
    by_time = dict(zip((f"{time:g}" for time in times_s), values, strict=True))
    return {f"{time:g}": by_time.get(f"{time:g}") for time in TIMES_S}


def _coverage(steps: pd.DataFrame) -> Json:
    """Return the coverage of the 90 % ellipses at ``TIMES_S``, by the time as text."""
    found: Json = {f"{time:g}": None for time in TIMES_S}
    if len(steps):
        for time, value in average(totals(steps, ["time_s"]))["coverage_90"].items():
            if f"{time:g}" in found:
                found[f"{time:g}"] = none(value)
    return found


def pooled_scores(sites: Sequence[Mapping[str, Json]]) -> dict[str, Json]:
    """Return the average over sites of each group: every site counts equally.

    Means of the values over the sites with at least :data:`LEAST_AGENTS` in the group; of the
    ratios the geometric mean, which is the same whichever of the two is divided by the other.
    ``sites`` is the number of these sites, ``n`` the sum over them.

    Args:
        sites: :func:`group_scores` of each.
    """
    groups = dict.fromkeys(group for scores in sites for group in scores)
    pooled = {}
    for group in groups:
        rows = [scores[group] for scores in sites if group in scores]
        rows = [row for row in rows if row["n"] >= LEAST_AGENTS]
        if rows:
            pooled[group] = _mean(rows)
    return pooled


def _mean(rows: Sequence[Json]) -> Json:
    found: Json = {"sites": len(rows), "n": sum(row["n"] for row in rows)}
    for key in dict.fromkeys(key for row in rows for key in row):  # earlier versions had fewer
        if key == "n":
            continue
        values = [row.get(key) for row in rows]
        nested = [value for value in values if isinstance(value, dict)]
        if nested:
            found[key] = {k: _average([value[k] for value in nested]) for k in nested[0]}
        else:
            found[key] = _average(values, geometric=key.startswith("ratio_"))
    return found


def _average(values: Sequence[float | None], geometric: bool = False) -> float | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    if geometric and min(known) > 0.0:
        return math.exp(sum(map(math.log, known)) / len(known))
    return sum(known) / len(known)


def is_scored(scores: Mapping[str, Json]) -> bool:
    """Whether any road user of a site was predicted and observed afterwards.

    Args:
        scores: :func:`group_scores` of the site.
    """
    return any(row["n"] for row in scores.values())


def worse_than_simple(scores: Json) -> bool:
    """Whether the ADE is known to be worse than that of the better baseline."""
    return is_worse(scores["ade"], [scores[f"ade_{name}"] for name in SIMPLE]) is True
