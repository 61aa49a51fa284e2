# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Order and colours of models and baselines."""

import pytest
from matplotlib.figure import Figure

from mtpgo_training.reports.series import (
    BASELINE_COLOURS,
    MODEL_COLOURS,
    colour,
    draw_line,
    series_names,
)

NAN = float("nan")


def content_of(*names):
    """Return content with results of all under both protocols."""
    baselines = ["cv", "ca", "ctrv"]
    return {"models": {n: {"all": {}, "centre": {}} for n in names}, "baselines": baselines}


def test_models_come_before_baselines_in_the_order_given():
    content = content_of("cv", "b", "ctrv", "a")
    assert series_names(content) == ["b", "a", "cv", "ctrv"]
    assert series_names(content, baselines=False) == ["b", "a"]


def test_a_model_without_results_for_all_agents_is_left_out():
    content = content_of("a", "b")
    del content["models"]["a"]["all"]
    assert series_names(content) == ["b"]


def test_a_model_has_the_colour_of_its_place_and_a_baseline_its_own():
    content = content_of("cv", *"abcdefg")
    colours = [colour(content, name) for name in "abcdefg"]
    assert colours == [*MODEL_COLOURS, MODEL_COLOURS[0]]
    assert colour(content, "cv") == BASELINE_COLOURS["cv"]
    assert not set(BASELINE_COLOURS.values()) & set(MODEL_COLOURS)


@pytest.mark.parametrize(
    ("values", "marked"),
    [
        ([1.0], [0]),
        ([1.0, 2.0], None),
        ([1.0, NAN, 2.0, 3.0], [0]),
        ([NAN, 1.0, NAN, 2.0], [1, 3]),
        ([NAN], None),
    ],
)
def test_points_without_a_neighbour_are_marked(values, marked):
    axes = Figure().add_subplot()
    draw_line(axes, list(range(len(values))), values, "--", color="k")
    (line,) = axes.get_lines()
    if marked is None:
        assert line.get_marker() in ("None", None)
    else:
        assert (line.get_marker(), line.get_markevery()) == ("o", marked)
    draw_line(axes, [0.0], [1.0], marker="x")
    assert axes.get_lines()[-1].get_marker() == "x"
