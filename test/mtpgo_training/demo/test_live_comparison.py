# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Live and recorded scores beside each other."""

import numpy as np

from mtpgo_core.quality.quality_report import QUALITY_ROW, SCORES
from mtpgo_training.demo.live_comparison import (
    compare_live,
    difference_sentences,
    largest_difference_m,
    live_comparison_table,
)
from mtpgo_training.table_format import to_text


def test_rows_of_the_longest_window_are_paired():
    live = np.zeros(4, dtype=QUALITY_ROW)
    live["window_s"], live["group"], live["time_s"] = [60, 1800, 1800, 1800], 1, [1, 1, 3, 5]
    live["agents"] = 4
    for name in SCORES:
        live[name] = [9.0, 0.5, 0.7, np.nan]
    offline = [
        {"window_s": w, "group": "vehicle_moving", "time_s": t, "agents": 4, "predictions": 0}
        | dict.fromkeys(SCORES, value)
        for w, t, value in ((60, 1, 9.0), (1800, 1, 0.5005), (1800, 3, 0.7), (1800, 5, None))
    ]
    rows = compare_live(live, offline)
    assert [row["time_s"] for row in rows] == [1, 3, 5]
    assert rows[0]["live"]["ade"] == 0.5
    assert rows[2]["live"]["ade"] is None
    assert abs(largest_difference_m(rows) - 0.0005) < 1e-9
    lines = to_text(live_comparison_table(rows)).splitlines()
    assert lines[1].startswith("moving vehicle, 1 s")
    assert lines[1].split("s")[-1].split()[:3] == ["4", "0.500", "0.500"]
    assert lines[3].split()[-2:] == ["-", "-"]


def test_other_road_users_are_named():
    def row(group, live, offline):
        both = {"ade": 0.5, "fde": 0.7, "cv_ade": None}
        sides = {"live": {"agents": live} | both, "offline": {"agents": offline} | both}
        for values in sides.values():
            values["predictions"] = 40
        return {"group": group, "time_s": 3} | sides

    same = row("vehicle_moving", 4, 4)
    (sentence,) = difference_sentences([same])
    assert sentence.endswith("0.000 mm at most, over the same road users and predictions.")
    first, second = difference_sentences([same, row("two_wheeler_standing", 4, 3)])
    assert first.endswith("over other road users and predictions.")
    assert second == "Not the same road users or predictions: standing two-wheeler at 3 s."


def test_nothing_recorded_is_nothing_compared():
    assert compare_live(np.empty(0, dtype=QUALITY_ROW), []) == []
    assert largest_difference_m([]) is None
    assert difference_sentences([]) == []
