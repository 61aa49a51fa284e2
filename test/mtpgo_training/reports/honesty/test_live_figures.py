# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of live scores and of what the online calibration changed."""

import pytest

from mtpgo_training.reports.honesty.live_figures import (
    calibration_effect_figure,
    live_coverage_figure,
    live_error_figure,
)


def row(group, time_s, window_s=1800, **values):
    scores = {"ade": 0.5 * time_s, "cv_ade": 0.75 * time_s, "coverage_50": 0.5, "coverage_90": 0.8}
    return {"window_s": window_s, "group": group, "time_s": time_s} | scores | values


def rows(group, **values):
    return [row(group, t, **values) for t in (1, 3, 5)]


def drawn(figure):
    """The lines with their labels, those of nominal values left out."""
    lines = [line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 3]
    return [(line.get_label(), list(line.get_ydata())) for line in lines]


def test_moving_groups_are_drawn_over_the_longest_window():
    own = rows("vehicle_moving") + rows("vehicle_moving", window_s=60, coverage_90=0.1)
    live = {"bag": own + rows("vehicle_standing") + rows("two_wheeler_moving", coverage_50=None)}
    assert drawn(live_coverage_figure(live)) == [
        ("vehicle", [0.8] * 3),
        ("_", [0.5] * 3),
        ("two-wheeler", [0.8] * 3),
    ]
    for draw in (live_coverage_figure, live_error_figure):
        assert (
            "moving" in draw(live).axes[0].get_title(loc="left") + draw(live).axes[0].get_title()
        )
    lines = drawn(live_error_figure(live))
    assert lines[:2] == [("vehicle", [0.5, 1.5, 2.5]), ("_", [0.75, 2.25, 3.75])]
    assert len(lines) == 4


def test_several_bags_are_told_apart():
    live = {name: rows("vehicle_moving") for name in ("a", "b")}
    labels = [label for label, _ in drawn(live_error_figure(live)) if label != "_"]
    assert labels == ["vehicle, a", "vehicle, b"]


def test_calibrations_are_drawn_side_by_side():
    def values(share):
        return {f"coverage_90_moving_{t}s": share for t in (1, 3, 5)}

    figure = calibration_effect_figure({"shipped": values(0.3), "online": values(0.9)})
    assert drawn(figure) == [("shipped", [0.3] * 3), ("online", [0.9] * 3)]
    assert figure.axes[0].get_ylim()[0] == pytest.approx(0.25)


def test_without_scores_nothing_is_drawn():
    unknown = rows("vehicle_moving", ade=None, coverage_90=None)
    for live in ({}, {"bag": rows("vehicle_standing")}, {"bag": unknown}):
        assert live_coverage_figure(live) is None
        assert live_error_figure(live) is None
    for effect in ({}, {"online": {"coverage_90_moving_1s": 0.9}}, {"a": {}, "b": {}}):
        assert calibration_effect_figure(effect) is None
