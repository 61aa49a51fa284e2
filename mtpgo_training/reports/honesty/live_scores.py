# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the scores that the node has of its own predictions, and of what it corrected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY, TIMES_S
from mtpgo_core.quality.quality_report import group_text
from mtpgo_core.task.calibration import GROUPS
from mtpgo_training.evaluation.scores.score_summary import value_text
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

EFFECT_TITLES = {
    "n": "n",
    "ade": "ADE m",
    "min_ade": "minADE m",
    "coverage_50": "in 50 %",
    "coverage_90": "in 90 %",
    **{MOVING_COVERAGE_KEY.format(t): f"moving, {t} s" for t in TIMES_S},
    "anll": "NLL",
}
"""Values by which calibrations are compared, and their heads."""

_TITLES = {
    "ade": "ADE m",
    "cv_ade": "CV ADE m",
    "fde": "FDE m",
    "miss_rate": "MR",
    "nll": "NLL",
    "coverage_50": "in 50 %",
    "coverage_90": "in 90 %",
}

_LIVE_TEXT = (
    "What the node itself had found out at the end of the bag, over the last half an hour: each "
    "prediction against the observations that followed it, by class group and motion when it was "
    "made."
)
_EFFECT_TEXT = (
    "Number of predictions of road users, errors of the heaviest and of the best mode, share of "
    "truths in the heaviest mode's ellipses of 50 and 90 %, of moving road users in that of 90 % "
    "at 1, 3 and 5 s, and the negative log-likelihood, on the same recordings at the same "
    "instants. Online: corrected by the outcomes of earlier predictions."
)


def live_table(rows: Sequence[Json], bag: str = "") -> Table | None:
    """Return the scores of the longest window, None if nothing was scored.

    Args:
        rows: of :func:`~mtpgo_training.evaluation.bags.replayed_quality.quality_rows`.
        bag: its name, for the heading.
    """
    lines = [
        Row(
            f"{group_text(GROUPS.index(row['group']))}, {row['time_s']} s",
            [
                str(row["agents"]),
                str(row["predictions"]),
                *(value_text(row[name], 3) for name in _TITLES),
            ],
        )
        for row in longest_window(rows)
    ]
    if not lines:
        return None
    heads = ["as the node scores it live", "road users", "predictions", *_TITLES.values()]
    return Table(heads, lines, f"Live scores: {bag}", _LIVE_TEXT)


def longest_window(rows: Sequence[Json]) -> list[Json]:
    """Return the rows of the longest window."""
    longest = max((row["window_s"] for row in rows), default=0)
    return [row for row in rows if row["window_s"] == longest]


def calibration_effect_table(effect: Mapping[str, Json]) -> Table | None:
    """Return what a calibration changes, None if there is nothing to compare.

    Args:
        effect: name of a calibration -> values of :data:`EFFECT_TITLES`, None where not defined.
    """
    if len(effect) < 2:
        return None
    rows = [
        Row(name, [value_text(scores.get(key), 2) for key in EFFECT_TITLES])
        for name, scores in effect.items()
    ]
    heads = ["calibration", *EFFECT_TITLES.values()]
    return Table(heads, rows, "What the online calibration changes", _EFFECT_TEXT)


def live_tables(content: Json) -> list[Table]:
    """Return the tables of the report: live scores by bag, and what the calibration changed."""
    tables = [live_table(rows, bag) for bag, rows in content.get("live", {}).items()]
    tables.append(calibration_effect_table(content.get("calibration_effect", {})))
    return [table for table in tables if table is not None]
