# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of honesty and plausibility, from the content of ``mtpgo evaluate --json``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from mtpgo_training.evaluation.scores.score_summary import POOLED_TITLES, value_text
from mtpgo_training.reports.series import PROTOCOL, colour, series_names
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

WORSE_MARK = "worse"
"""Marks a model that is worse than the better of constant velocity and acceleration."""

_COVERAGE_TEXT = (
    "Share of truths in the heaviest mode's ellipse and, in brackets, in the mixture's "
    "highest-density region of 50, 90 and 95 %. sigma is what the heaviest mode expects its RMSE "
    "to be; sigma / RMSE below 1 is overconfident."
)
_WEIGHTS_TEXT = (
    "Of several modes only. Brier score: 0 is best, 1 - 1/M are equal weights. nearest: share in "
    "which the heaviest mode ends nearest to the truth, and by chance. ECE: difference of weights "
    "and shares. apart: distance of two modes drawn by weight. within 1 m: weight of the modes "
    "that end within 1 m of the heaviest."
)
_PATHS_TEXT = (
    "Of the heaviest mode. reverses, lateral: moving vehicles that are predicted to drive back, "
    "steps above 4 and 8 m/s^2 and, in brackets, those of the recorded positions. creep: "
    "predicted displacement of road users that stand and stay, and share above 0.5 m. overlap: "
    "share whose box meets another's that it did not meet."
)
_SPLITS = {"by_class_and_motion": "by class and motion", "by_speed": "by speed (m/s)"}
_FEASIBLE_HEADS = (
    *("reverses", "lateral > 4 (truth)", "> 8 (truth)"),
    *("creep m", "creeps", "overlap"),
)
_COMPARISON_TEXT = (
    "ADE of each class and motion against constant velocity and acceleration. Marked where the "
    "model is more than 2 % worse than the better of the two."
)


def coverage_table(
    content: Json, groups: Sequence[str] = ("moving",), breakdown: str = "by_motion"
) -> Table | None:
    """Return coverage, sharpness and likelihood at 1, 3 and 5 s, None without any.

    Args:
        content: of the evaluation.
        groups: ``all`` or groups of the breakdown; a row for each and model.
        breakdown: its name in the JSON.
    """
    rows, times = [], [1, 3, 5]
    for group in groups:
        for name, values in _series(content, group, breakdown):
            if all(value is None for value in values["nll"]):
                continue
            cells = []
            for percent in (50, 90, 95):
                pairs = zip(values[f"ellipse_{percent}"], values[f"region_{percent}"], strict=True)
                cells += [_pair(ellipse, region) for ellipse, region in pairs]
            spread = values["spread"]
            at = [spread["time_s"].index(t) for t in times]
            cells += [
                *(
                    f"{value_text(spread['sigma'][k], 2)} ({value_text(spread['rmse'][k], 2)})"
                    for k in at
                ),
                *(value_text(spread["ratio"][k], 2) for k in at),
                *(value_text(value, 2) for value in values["nll"]),
            ]
            rows.append(_row(content, group, name, [*cells, str(values["n"])], groups))
    heads = [
        *(f"{percent}% {t}s" for percent in (50, 90, 95) for t in times),
        *(f"sigma (RMSE) {t}s" for t in times),
        *(f"ratio {t}s" for t in times),
        *(f"NLL {t}s" for t in times),
        "agents",
    ]
    if not rows:
        return None
    first = ", ".join(groups) if len(groups) == 1 else ""
    return Table([first, *heads], rows, "Honesty: coverage and sharpness", _COVERAGE_TEXT)


def headline_table(content: Json) -> Table | None:
    """Return the coverage of moving road users in the terminal's width, None without any."""
    rows = []
    for name, values in _series(content, "moving"):
        if any(value is not None for value in values["nll"]):
            pairs = list(zip(values["ellipse_90"], values["region_90"], strict=True))
            ratio = values["spread"]["ratio"]
            cells = [_pair(ellipse, region) for ellipse, region in pairs]
            cells += [value_text(ratio[k], 2) for k in (0, 2, 4)]
            cells += [value_text(value, 2) for value in values["nll"]]
            rows.append(Row(name, [*cells, str(values["n"])]))
    heads = [
        "moving, in 90% ellipse (mixture)",
        *("1 s", "3 s", "5 s", "sigma/RMSE 1 s", "3 s", "5 s", "NLL 1 s", "3 s", "5 s", "agents"),
    ]
    return Table(heads, rows) if rows else None


def weights_table(
    content: Json, groups: Sequence[str] = ("moving",), breakdown: str = "by_motion"
) -> Table | None:
    """Return the quality of the mode weights and the modes' diversity, None without any.

    Args:
        content: of the evaluation.
        groups: see :func:`coverage_table`.
        breakdown: see there.
    """
    rows = []
    for group in groups:
        for name, values in _series(content, group, breakdown):
            weights, diversity = values["weights"], values["diversity"]
            if weights["chance"] is None:
                continue
            cells = [
                value_text(weights["brier"]),
                _pair(weights["heaviest_nearest"], weights["chance"]),
                value_text(weights["calibration_error"]),
                value_text(weights["brier_min_fde"], 2),
                value_text(weights["brier_min_ade"], 2),
                value_text(diversity["mode_distance"], 2),
                value_text(diversity["weight_near_heaviest"]),
            ]
            rows.append(_row(content, group, name, cells, groups))
    heads = [
        f"weights, {groups[0]}" if len(groups) == 1 else "weights",
        *("Brier", "nearest (chance)", "ECE", "brier-minFDE m", "brier-minADE m"),
        *("apart m", "within 1 m"),
    ]
    return Table(heads, rows, "Honesty: weights of the modes", _WEIGHTS_TEXT) if rows else None


def paths_table(content: Json) -> Table | None:
    """Return jumps and feasibility of all series, None without any."""
    by_motion = [dict(_series(content, motion)) for motion in ("moving", "standing")]
    rows = []
    for name, values in _series(content, "all"):
        moving, standing = (found.get(name, {}).get("consistency", {}) for found in by_motion)
        cells = [_jump(moving, "jump"), _jump(moving, "mixture_jump"), _jump(standing, "jump")]
        rows.append(_row(content, "", name, [*cells, *_feasible_cells(values)]))
    heads = ["paths", "jump m (95 %)", "mixture", "standing", *_FEASIBLE_HEADS]
    if not rows:
        return None
    return Table(heads, rows, "Plausibility", f"{jump_text(content)} {_PATHS_TEXT}")


def group_paths_table(content: Json, groups: Sequence[str], breakdown: str) -> Table | None:
    """Return jumps and feasibility of the groups of a breakdown, None without any.

    Args:
        content: of the evaluation.
        groups: see :func:`coverage_table`.
        breakdown: see there.
    """
    rows = []
    for group in groups:
        for name, values in _series(content, group, breakdown):
            cells = [_jump(values["consistency"], key) for key in ("jump", "mixture_jump")]
            rows.append(_row(content, group, name, [*cells, *_feasible_cells(values)], groups))
    first = f"paths, {groups[0]}" if len(groups) == 1 else "paths"
    heads = [first, "jump m (95 %)", "mixture", *_FEASIBLE_HEADS]
    return Table(heads, rows, "Plausibility", _PATHS_TEXT) if rows else None


def _jump(consistency: Json, key: str) -> str:
    """Return the mean of a jump and its quantile."""
    mean, quantile = consistency.get(key), consistency.get(f"{key}_95")
    return "-" if mean is None else f"{value_text(mean, 2)} ({value_text(quantile, 2)})"


def _feasible_cells(values: Json) -> list[str]:
    feasible = values["feasibility"]
    return [
        _percent(feasible["reverses"]),
        *(_percents(feasible, key) for key in ("lateral_4", "lateral_8")),
        value_text(feasible["creep"], 2),
        _percent(feasible["creeps"]),
        _percent(feasible["overlaps"]),
    ]


def jump_text(content: Json) -> str:
    """Return a sentence on what the jumps are, or why there are none."""
    cycles = {
        values["consistency"]["cycle_s"]
        for _, values in _series(content, "all")
        if values["consistency"]["cycle_s"] is not None
    }
    if not cycles:
        return (
            "Jumps are not available: no two scored instants are a whole number of the model's "
            "steps, and at most 1 s, apart."
        )
    apart = " to ".join(f"{value:.2g} s" for value in sorted({min(cycles), max(cycles)}))
    return (
        "jump: distance between the last point predicted for moving road users and what is "
        f"predicted for the same time {apart} later; mixture: that of the mean of all modes; "
        "standing: the jump of standing road users."
    )


def comparison_table(content: Json) -> Table | None:
    """Return each class and motion beside constant velocity and acceleration, None without any."""
    rows = []
    for name, protocols in content.get("groups", {}).items():
        for group, row in protocols.get(PROTOCOL, {}).items():
            cells = [value_text(row[key]) for key in ("ade", "cv", "ca")]
            cells += [value_text(row[key], 2) for key in ("ade_to_cv", "ade_to_ca")]
            cells += [WORSE_MARK if row["worse"] else "-", str(row["n"])]
            rows.append(Row(f"{group}: {name}", cells, colour(content, name)))
    heads = ["ADE m", "model", "cv", "ca", "/ cv", "/ ca", "> 2 % worse", "agents"]
    if not rows:
        return None
    return Table(heads, rows, "Against simple motion", _COMPARISON_TEXT)


def breakdown_table(content: Json, name: str, heading: str) -> Table | None:
    """Return honesty at 1, 3 and 5 s for the groups of a breakdown, None without any.

    Args:
        content: of the evaluation.
        name: of the breakdown in the JSON.
        heading: of the table.
    """
    rows, groups = [], _groups(content, name)
    for group in groups:
        for series, values in _series(content, group, name):
            if all(value is None for value in values["nll"]):
                continue
            cells = [
                _pair(*(values[f"{kind}_90"][k] for kind in ("ellipse", "region")))
                for k in range(3)
            ]
            cells += [value_text(values["spread"]["sigma"][4], 2)]
            cells += [value_text(values["spread"]["rmse"][4], 2)]
            cells += [value_text(values["spread"]["ratio"][4], 2)]
            cells += [value_text(values["nll"][2], 2), str(values["n"])]
            rows.append(_row(content, group, series, cells, groups))
    heads = [
        "",
        "90% 1s",
        "90% 3s",
        "90% 5s",
        "sigma 5s",
        "RMSE 5s",
        "ratio 5s",
        "NLL 5s",
        "agents",
    ]
    return Table(heads, rows, heading, "") if rows else None


def pooled_table(content: Json) -> Table | None:
    """Return the coverages over all steps and agents, None without any."""
    rows = []
    for name in series_names(content):
        scores = content["models"][name][PROTOCOL]
        if scores["coverage_90"] is not None:
            cells = [value_text(scores[key]) for key in POOLED_TITLES]
            rows.append(_row(content, "", name, cells))
    text = "Over all steps and road users: many stand, and the first steps are easy."
    heads = ["", *POOLED_TITLES.values()]
    return Table(heads, rows, "Coverage, pooled", text) if rows else None


def honesty_tables(content: Json) -> list[Table]:
    """Return all tables of the report."""
    groups = ("moving", "standing", "all")
    tables = [
        comparison_table(content),
        coverage_table(content, groups),
        weights_table(content, groups),
        paths_table(content),
        breakdown_table(content, "by_class_and_motion", "Coverage by class and motion"),
        breakdown_table(content, "by_speed", "Coverage by speed (m/s)"),
        breakdown_table(content, "by_site_and_motion", "Coverage by site and motion"),
        pooled_table(content),
    ]
    return [table for table in tables if table is not None]


def split_tables(content: Json) -> list[Table]:
    """Return coverage, weights and paths by class and motion and by speed."""
    kinds = {
        "Coverage and sharpness": coverage_table,
        "Weights of the modes": weights_table,
        "Plausibility": group_paths_table,
    }
    tables = []
    for breakdown, by in _SPLITS.items():
        groups = _groups(content, breakdown)
        for heading, make in kinds.items():
            table = make(content, groups, breakdown)
            if table is not None:
                tables.append(replace(table, heading=f"{heading} {by}", text=""))
    return tables


def _series(content: Json, group: str, breakdown: str = "by_motion") -> list[tuple[str, Json]]:
    """Return name and values of each model and baseline, of all agents or a breakdown's group."""
    own = content.get("honesty", {})
    found = []
    for name in series_names(content):
        protocols = own.get(name, {})
        if PROTOCOL in protocols:
            values = protocols[PROTOCOL]
            values = values["all"] if group == "all" else values[breakdown].get(group)
            if values is not None:
                found.append((name, values))
    return found


def _groups(content: Json, breakdown: str) -> list[str]:
    """Return the groups of a breakdown that any model or baseline has."""
    own = content.get("honesty", {})
    protocols = [own.get(name, {}) for name in series_names(content)]
    found = [values[PROTOCOL][breakdown] for values in protocols if PROTOCOL in values]
    return list(dict.fromkeys(group for groups in found for group in groups))


def _row(
    content: Json, group: str, name: str, cells: Sequence[str], groups: Sequence[str] = ()
) -> Row:
    label = f"{group}: {name}" if len(groups) > 1 else name
    return Row(label, cells, colour(content, name), name in content["baselines"])


def _pair(value: float | None, other: float | None) -> str:
    return "-" if value is None else f"{value_text(value)} ({value_text(other)})"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"


def _percents(feasible: Json, key: str) -> str:
    """Return a share of the predictions and, in brackets, of the truth."""
    share, truth = feasible[key], feasible[f"truth_{key}"]
    return "-" if share is None else f"{_percent(share)} ({_percent(truth)})"
