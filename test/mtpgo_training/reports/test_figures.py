# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of the report, from known scores."""

import pytest
from known_scores import add, json_content

from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.reports import figures
from mtpgo_training.reports.figures import draw_figures
from mtpgo_training.reports.series import colour


@pytest.fixture(scope="module")
def content():
    return json_content()


def test_figures_have_one_colour_for_each_model(content, tmp_path):
    paths = draw_figures(content, tmp_path)
    assert set(paths) == {"horizon", "reliability", "nees", "manoeuvres"}
    assert len({colour(content, name) for name in content["models"]}) == 3
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.png" for name in paths}


def content_of(errors, spread):
    """Return the content with one model or baseline for each error (m)."""
    table = ScoreTable()
    for name, error in errors.items():
        add(table, error, "01", name, spread=spread)
    baselines = ["cv", "ca", "ctrv"]
    return {"models": table.averages(), **breakdowns(table), "baselines": baselines}


def test_without_covariances_there_is_no_figure_of_calibration():
    content = content_of({"m": 1.0, "cv": 2.0}, None)
    assert figures._reliability(content) is None
    assert figures._nees(content) is None
    assert figures._horizon(content) is not None


def test_constant_acceleration_does_not_determine_the_scale_of_the_errors():
    figure = figures._horizon(content_of({"m": 1.0, "cv": 2.0, "ca": 50.0}, None))
    assert figure.axes[0].get_ylim() == pytest.approx((0.0, 1.25 * 2.0))
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["m", "cv", "ca (goes beyond the top, to 50.0 m)"]


def test_baselines_are_told_apart_by_their_line_styles():
    figure = figures._horizon(content_of({"m": 1.0, "cv": 2.0, "ca": 2.1, "ctrv": 2.2}, None))
    # The dashes as matplotlib was given them: it has no public way to ask for them.
    assert len({str(line._unscaled_dash_pattern) for line in figure.axes[0].lines}) == 4
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["m", "cv", "ca", "ctrv"]


def test_a_far_too_large_nees_is_cut_off():
    # An error of 30 standard deviations has a NEES of 900.
    for error, top in ((1.0, 1.1 * 4.0), (30.0, 20.0)):
        figure = figures._nees(content_of({"m": error}, 1.0))
        assert figure.axes[0].get_ylim() == pytest.approx((0.0, top))
        labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
        assert labels == ["m", "m, whole mixture"]


def test_the_bars_are_the_ade_by_manoeuvre(content):
    figure = figures._manoeuvres(content)
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    assert heights == pytest.approx([1.25, 2.5, 5.0])
    labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert labels == ["lane keep\n(6)"]
