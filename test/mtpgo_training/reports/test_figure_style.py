# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np

from mtpgo_training.reports.figure_style import line_style, new_axes, numbers


def test_models_and_baselines_have_different_lines():
    content = {"models": {"m": {"all": {}}, "cv": {"all": {}}}, "baselines": ["cv"]}
    model, baseline = line_style(content, "m"), line_style(content, "cv")
    assert (model["ls"], model["label"]) == ("-", "m")
    assert baseline["ls"] != "-"
    assert model["color"] != baseline["color"]
    assert model["lw"] > baseline["lw"]


def test_values_that_are_not_defined_leave_a_gap():
    np.testing.assert_array_equal(numbers([1.0, None]), [1.0, np.nan])


def test_a_figure_has_the_given_size():
    figure, axes = new_axes(4.0, 3.0)
    assert tuple(figure.get_size_inches()) == (4.0, 3.0)
    assert axes in figure.axes
