# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The values of a honesty table as plain data: overall, by motion, class, speed and site."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_training.evaluation.honesty.agent_honesty import PERCENTS, SPREAD_TIMES_S
from mtpgo_training.evaluation.honesty.feasibility import LATERAL_MPS2
from mtpgo_training.evaluation.honesty.honesty_table import CLASS_GROUPS, SPEED_BANDS, HonestyTable
from mtpgo_training.evaluation.honesty.mode_weights import BINS, calibration_error
from mtpgo_training.evaluation.scores.score_table import SINCE_START_BANDS, none, totals

Json = dict[str, Any]

BREAKDOWNS: dict[str, tuple[str, ...]] = {
    "by_motion": ("motion",),
    "by_class": ("agent_class",),
    "by_class_and_motion": ("agent_class", "motion"),
    "by_class_group": ("class_group",),
    "by_class_group_and_motion": ("class_group", "motion"),
    "by_speed": ("speed",),
    "by_site_and_motion": ("site", "motion"),
    "by_since_start_and_motion": ("since_start", "motion"),
}
"""Name in the JSON -> columns; the names of a group's columns are joined by ``, ``."""

QUANTILE = 0.95
"""Of the jumps, beside their mean."""

_SERIES = ("model", "protocol")
_ORDER = {
    name: i
    for names in (CLASS_GROUPS, SPEED_BANDS, SINCE_START_BANDS)
    for i, name in enumerate(names)
}


def honesty_summary(table: HonestyTable) -> Json:
    """Return by model and protocol: ``all``, and by name of :data:`BREAKDOWNS` and group.

    Each of them is the content of :func:`honesty_values`.
    """
    sums, jumps = table.sums(), table.jumps()
    content: Json = {}
    for (model, protocol), values in honesty_values(sums, jumps, _SERIES).items():
        content.setdefault(model, {})[protocol] = {"all": values} | {k: {} for k in BREAKDOWNS}
    for name, columns in BREAKDOWNS.items():
        found = honesty_values(sums, jumps, (*_SERIES, *columns))
        ordered = sorted(found, key=lambda group: [_ORDER.get(str(part), -1) for part in group])
        for group in ordered:
            place = content[group[0]][group[1]][name]
            place[", ".join(map(str, group[2:]))] = found[group]
    return content


def honesty_values(
    sums: pd.DataFrame, jumps: pd.DataFrame, by: Sequence[str]
) -> dict[tuple[Any, ...], Json]:
    """Return the values of each group of agents; None for what is not defined.

    ``n``: agents. ``time_s`` with lists over it: ``ellipse_50``, ``_90``, ``_95`` and
    ``region_50``, ``_90``, ``_95`` (shares of truths inside), ``nll`` (nats). ``spread``: lists
    ``time_s``, ``sigma`` (m, the root of the mean trace of the heaviest mode's covariance),
    ``rmse`` (m) of it, ``ratio`` of the two: less than 1 is overconfident. ``weights``:
    ``brier``, ``heaviest_nearest``, ``chance``, ``brier_min_fde``, ``brier_min_ade`` (m),
    ``calibration_error`` and, over bins, ``reliability`` with ``weight``, ``nearest``, ``count``.
    ``diversity``: ``mode_distance`` (m), ``weight_near_heaviest``. ``consistency``: ``cycle_s``,
    ``jump``, ``jump_95``, ``mixture_jump``, ``mixture_jump_95`` (m), ``n``. ``feasibility``:
    ``reverses``, ``creep`` (m), ``creeps``, ``lateral_4``, ``lateral_8`` and, of the truth,
    ``truth_lateral_4``, ``truth_lateral_8``, ``overlaps``.

    Args:
        sums: :meth:`HonestyTable.sums`, or some of its rows.
        jumps: :meth:`HonestyTable.jumps`, or some of its rows.
        by: their columns; the keys of the result are tuples of the values.
    """
    if not len(sums):
        return {}
    total = totals(sums, by)
    added, counts = total["sum"], total["count"]
    columns = list(added.columns)
    quantiles: dict[Any, Any] = {}
    if len(jumps):
        grouped = jumps.groupby(list(by), observed=True)[["jump", "mixture_jump"]]
        quantiles = grouped.quantile(QUANTILE).to_dict("index")
    found: dict[tuple[Any, ...], Json] = {}
    for group, add, count in zip(total.index, added.to_numpy(), counts.to_numpy(), strict=True):
        own = {name: (float(s), float(c)) for name, s, c in zip(columns, add, count, strict=True)}
        key = group if isinstance(group, tuple) else (group,)
        found[key] = _values(own, quantiles.get(group, {}))
    return found


def _values(own: dict[str, tuple[float, float]], quantiles: dict[str, float]) -> Json:
    """Return the values of one group from sum and count by name."""

    def mean(name: str) -> float:
        total, count = own[name]
        return total / count if count else float("nan")

    def means(*names: str) -> Json:
        return {name: none(mean(name)) for name in names}

    sigma = [float(np.sqrt(mean(f"variance_{t}s"))) for t in SPREAD_TIMES_S]
    rmse = [float(np.sqrt(mean(f"squared_error_{t}s"))) for t in SPREAD_TIMES_S]
    ratio = [s / e if e > 0.0 else float("nan") for s, e in zip(sigma, rmse, strict=True)]
    bins = {
        kind: np.array([own[f"bin_{kind}_{b}"][0] for b in range(BINS)])
        for kind in ("count", "weight", "nearest")
    }
    count = np.where(bins["count"] > 0, bins["count"], np.nan)
    content: Json = {"n": int(own["agents"][1]), "time_s": list(TIMES_S)}
    for kind in ("ellipse", "region"):
        for percent in PERCENTS:
            names = [f"{kind}_{percent}_{t}s" for t in TIMES_S]
            content[f"{kind}_{percent}"] = [none(mean(name)) for name in names]
    return content | {
        "nll": [none(mean(f"nll_{t}s")) for t in TIMES_S],
        "spread": {
            "time_s": list(SPREAD_TIMES_S),
            "sigma": [none(value) for value in sigma],
            "rmse": [none(value) for value in rmse],
            "ratio": [none(value) for value in ratio],
        },
        "weights": means("brier", "heaviest_nearest", "chance", "brier_min_fde", "brier_min_ade")
        | {
            "calibration_error": none(calibration_error(*bins.values())),
            "reliability": {
                "weight": [none(value) for value in bins["weight"] / count],
                "nearest": [none(value) for value in bins["nearest"] / count],
                "count": bins["count"].astype(int).tolist(),
            },
        },
        "diversity": means("mode_distance", "weight_near_heaviest"),
        "consistency": means("cycle_s", "jump", "mixture_jump")
        | {f"{name}_95": none(quantiles.get(name, np.nan)) for name in ("jump", "mixture_jump")}
        | {"n": int(own["jump"][1])},
        "feasibility": means(
            "reverses",
            "creep",
            "creeps",
            *(f"{who}lateral_{limit:g}" for who in ("", "truth_") for limit in LATERAL_MPS2),
            "overlaps",
        ),
    }
