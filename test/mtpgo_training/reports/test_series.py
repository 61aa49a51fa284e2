# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Order and colours of models and baselines."""

from mtpgo_training.reports.series import (
    BASELINE_COLOURS,
    MODEL_COLOURS,
    colour,
    series_names,
)


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
