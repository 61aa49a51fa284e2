# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's scores of its own predictions beside those computed from the recorded bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality.quality_report import SCORES, group_text
from mtpgo_core.task.calibration import GROUPS
from mtpgo_training.evaluation.scores.score_summary import value_text
from mtpgo_training.table_format import Row, Table

Json = dict[str, Any]

_SHOWN = {"ade": "ADE m", "cv_ade": "CV ADE m", "nll": "NLL", "coverage_90": "in 90 %"}
_TEXT = "The scores of the node itself at the end, beside the same scores computed from its bag."
_IN_METRES = ("ade", "fde", "cv_ade")


def compare_live(live: NDArray[Any], offline: Sequence[Mapping[str, Any]]) -> list[Json]:
    """Return the scores of the longest window of both, by group and time ahead.

    Args:
        live: rows of ``QUALITY_ROW``, the node's last ones.
        offline: rows of
            :func:`~mtpgo_training.evaluation.bags.replayed_quality.quality_rows`.

    Returns:
        Rows with ``window_s``, ``group``, ``time_s``, and for ``live`` and ``offline`` the number
        of road users and the scores, None where there are none.
    """
    longest = max((row["window_s"] for row in offline), default=0)
    mine = {
        (GROUPS[row["group"]], int(row["time_s"])): row
        for row in live[live["window_s"] == longest]
    }
    rows = []
    for other in offline:
        own = mine.get((other["group"], other["time_s"]))
        if other["window_s"] != longest or own is None:
            continue
        values = {name: own[name].item() for name in ("agents", "predictions", *SCORES)}
        values = {k: v if np.isfinite(v) else None for k, v in values.items()}
        rows.append(
            {
                "window_s": longest,
                "group": other["group"],
                "time_s": other["time_s"],
                "live": values,
                "offline": {name: other[name] for name in values},
            }
        )
    return rows


def largest_difference_m(rows: Sequence[Json]) -> float | None:
    """Return the largest difference between two errors of :func:`compare_live` (m)."""
    pairs = [(row["live"][name], row["offline"][name]) for row in rows for name in _IN_METRES]
    known = [abs(a - b) for a, b in pairs if a is not None and b is not None]
    return max(known, default=None)


def difference_sentences(rows: Sequence[Json]) -> list[str]:
    """Return sentences on how far live and recorded scores differ."""
    different = [
        f"{group_text(GROUPS.index(row['group']))} at {row['time_s']} s"
        for row in rows
        if any(row["live"][name] != row["offline"][name] for name in ("agents", "predictions"))
    ]
    difference_m = largest_difference_m(rows)
    sentences = []
    if difference_m is not None:
        over = "other" if different else "the same"
        sentences.append(
            f"Live and recorded errors differ by {1e3 * difference_m:.3f} mm at most, over {over} "
            "road users and predictions."
        )
    if different:
        sentences.append(f"Not the same road users or predictions: {', '.join(different)}.")
    return sentences


def live_comparison_table(rows: Sequence[Json]) -> Table:
    """Return the table that the demo prints."""
    lines = [
        Row(
            f"{group_text(GROUPS.index(row['group']))}, {row['time_s']} s",
            [
                str(row["live"]["agents"]),
                *(value_text(row[side][name]) for name in _SHOWN for side in ("live", "offline")),
            ],
        )
        for row in rows
    ]
    heads = [head for title in _SHOWN.values() for head in (f"{title} live", "bag")]
    heads = ["scores of the node and of its bag", "road users", *heads]
    return Table(heads, lines, "Live scores", _TEXT)
