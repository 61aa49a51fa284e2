# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the scores that the node has of its own predictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mtpgo_training.evaluation.scores.score_summary import value_text
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

_TITLES = {
    "ade": "ADE m",
    "cv_ade": "CV ADE m",
    "fde": "FDE m",
    "miss_rate": "MR",
    "nll": "NLL",
    "coverage_50": "in 50 %",
    "coverage_90": "in 90 %",
}


def live_table(rows: Sequence[Json]) -> Table | None:
    """Return the scores of the longest window, None if nothing was scored.

    Args:
        rows: of :func:`~mtpgo_training.evaluation.bags.replayed_quality.quality_rows`.
    """
    longest = max((row["window_s"] for row in rows), default=0)
    lines = [
        Row(
            f"{row['group'].replace('_', ' ')}, {row['time_s']} s",
            [
                str(row["agents"]),
                str(row["predictions"]),
                *(value_text(row[name], 3) for name in _TITLES),
            ],
        )
        for row in rows
        if row["window_s"] == longest
    ]
    if not lines:
        return None
    heads = ["as the node scores it live", "road users", "predictions", *_TITLES.values()]
    return Table(heads, lines)
