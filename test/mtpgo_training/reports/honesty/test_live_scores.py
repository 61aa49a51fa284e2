# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the node's scores, and of what its calibration changed."""

from mtpgo_training.reports.honesty.live_scores import (
    calibration_effect_table,
    live_table,
    live_tables,
)
from mtpgo_training.table_format import to_text


def row(window_s, **values):
    scores = {"ade": 0.5, "cv_ade": 0.75, "fde": 1.0, "miss_rate": 0.1, "nll": 1.5}
    scores |= {"coverage_50": 0.4, "coverage_90": None}
    return {"window_s": window_s, "group": "two_wheeler_moving", "time_s": 3} | (
        {"agents": 12, "predictions": 300, "by_model": 300} | scores | values
    )


def test_the_longest_window_is_shown():
    text = to_text(live_table([row(60), row(1800, ade=0.625)]))
    assert len(text.splitlines()) == 2
    name, scores = text.splitlines()[1].split(", 3 s")
    assert name == "moving two-wheeler"
    expected = "12 300 0.625 0.750 1.000 0.100 1.500 0.400 -"
    assert " ".join(scores.split()) == expected


def test_the_report_has_the_scores_of_each_bag_and_what_the_calibration_changed():
    effect = {"m, shipped": {"coverage_90": 0.7}}
    effect["m, online"] = {"n": 12, "ade": 1.5, "coverage_90": 0.9}
    content = {"live": {"bag": [row(1800)]}, "calibration_effect": effect}
    tables = live_tables(content)
    assert [table.heading for table in tables] == [
        "Live scores: bag",
        "What the online calibration changes",
    ]
    online = to_text(tables[1]).splitlines()[2].split()
    assert online[:7] == ["m,", "online", "12", "1.50", "-", "-", "0.90"]
    assert live_tables({}) == []
    assert calibration_effect_table({"m, shipped": {}}) is None
