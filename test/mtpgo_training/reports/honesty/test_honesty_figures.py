# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of honesty, from known paths."""

import copy

import pytest
from known_paths import honest_content
from known_scores import json_content

from mtpgo_training.reports.honesty.honesty_figures import (
    coverage_figure,
    spread_figure,
    weights_figure,
)


def lines(figure):
    """Return the values of each line of a figure by its label."""
    return {line.get_label(): list(line.get_ydata()) for line in figure.axes[0].lines}


def test_coverage_is_drawn_with_its_nominal_level():
    figure = coverage_figure(honest_content())
    found = lines(figure)
    assert found["m"] == [0.0] * 3
    assert found["m, mixture"] == [1.0] * 3
    assert [0.9, 0.9] in found.values()
    assert figure.axes[0].get_ylim()[0] == 0.0  # the lowest value can be seen


def test_sigma_and_rmse_are_drawn_together():
    found = lines(spread_figure(honest_content()))
    assert found["m, RMSE"] == pytest.approx([3.0] * 5)
    assert found["m, sigma"] == pytest.approx([2**0.5] * 5)


def test_weights_are_drawn_against_the_share_that_was_nearest():
    figure = weights_figure(honest_content())
    assert lines(figure)["m"] == [1.0, 0.0]
    assert "cv" not in lines(figure)
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["m", "area: number of modes"]


def test_small_weights_fill_their_figure():
    content = copy.deepcopy(honest_content())
    honesty = content["honesty"]["m"]["all"]["by_motion"]["moving"]["weights"]
    honesty["reliability"] = {"weight": [0.1, 0.2, None], "nearest": [0.1, 0.3, None]}
    honesty["reliability"]["count"] = [5, 7, 0]
    axes = weights_figure(content).axes[0]
    assert axes.get_xlim() == axes.get_ylim() == pytest.approx((0.05, 0.35))


def test_without_values_there_is_no_figure():
    content = copy.deepcopy(honest_content())
    for protocols in content["honesty"].values():
        protocols["all"]["by_motion"].pop("moving")
    for draw in (coverage_figure, spread_figure, weights_figure):
        assert draw(content) is None
        assert draw(json_content()) is None
