# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The breakdowns of a score table, against sums worked out by hand."""

import pytest
from known_scores import STANDS, TURNS, H, add, filled

from mtpgo_training.evaluation.scores.agent_scores import LEVELS
from mtpgo_training.evaluation.scores.score_summary import averages_table, breakdowns, titles_of
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.table_format import to_text


def test_groups_have_their_own_averages():
    found = breakdowns(filled())
    assert {k: v["ade"] for k, v in found["by_class"]["m"]["all"].items()} == {
        "car": pytest.approx((4 * 1.0 + 2 * 4.0) / 6),
        "truck": 2.0,
    }
    assert {k: (v["ade"], v["n"]) for k, v in found["by_manoeuvre"]["m"]["all"].items()} == {
        "lane_keep": (1.0, 4),
        "standing": (2.0, 2),
    }
    assert {k: v["ade"] for k, v in found["by_recording"]["m"]["all"].items()} == {
        "01": 1.0,
        "02": 2.0,
        "03": 4.0,
    }
    assert found["by_class"]["m"]["all"]["truck"]["fde"] == 2.0


def test_moving_and_turning_ones_are_given_by_the_time_since_the_start():
    table = ScoreTable()
    add(table, 1.0, n=3, since_start_s=5.0)
    add(table, 2.0, n=1, since_start_s=5.0, bits=TURNS)
    add(table, 9.0, n=7, since_start_s=5.0, bits=STANDS, speed=0.0)
    add(table, 3.0, n=2, since_start_s=300.0)
    found = breakdowns(table)["by_since_start"]["m"]["all"]
    assert {name: (row["ade"], row["n"]) for name, row in found.items()} == {
        "moving, 0-20 s": (1.25, 4),
        "moving, 120+ s": (3.0, 2),
        "turning, 0-20 s": (2.0, 1),
    }
    assert breakdowns(filled())["by_since_start"]["m"]["all"] == {}  # it is not known


def test_the_horizon_counts_observed_agents():
    rows = breakdowns(filled())["by_horizon"]["m"]["all"]
    assert rows["time_s"] == [0.2, 0.4, 0.6, 0.8, 1.0]
    assert rows["n"] == [8, 8, 8, 6, 6]
    assert rows["nees_expected"] == 2.0
    assert rows["displacement"] == pytest.approx([2.0, 2.0, 2.0, 8 / 6, 8 / 6])
    # With unit covariance the NEES is the squared distance, by mode and by mixture alike.
    squared = [(4 * 1 + 2 * 4 + 2 * 16) / 8] * 3 + [(4 * 1 + 2 * 4) / 6] * 2
    assert rows["nees"] == pytest.approx(squared)
    assert rows["nees_mixture"] == pytest.approx(squared)
    assert rows["displacement_low"][0] < 2.0 < rows["displacement_high"][0]


def test_reliability_agrees_with_the_coverages():
    table = filled()
    found = breakdowns(table)["reliability"]["m"]["all"]
    at = dict(zip(found["level"], found["observed"], strict=True))
    scores = table.averages()["m"]["all"]
    for percent in (50, 90, 95):
        assert at[percent / 100] == pytest.approx(scores[f"coverage_{percent}"])
    # A distance of 1 lies in the ellipses from 1 - exp(-1 / 2) = 39 % on, 2 from 86 % on.
    assert at[0.35] == 0.0
    assert at[0.4] == pytest.approx(4 / 8)
    assert at[0.9] == pytest.approx(6 / 8)
    assert found["level"] == list(LEVELS)


def test_intervals_over_recordings_and_the_share_of_constant_velocity():
    found = breakdowns(filled())
    low, high = found["intervals"]["m"]["all"]["ade"]
    assert low == pytest.approx(1.0)  # 01 drawn three times
    assert 2.0 < high <= 4.0
    share = found["relative"]["m"]["all"]["ade"]
    assert share["value"] == pytest.approx(2.0 / 4.0)
    assert share["low"] == pytest.approx(0.25)
    assert found["relative"]["cv"]["all"]["ade"] == {"value": 1.0, "low": 1.0, "high": 1.0}


def test_there_is_no_share_of_a_baseline_without_error():
    table = ScoreTable()
    add(table, 1.0)
    add(table, 0.0, model="cv")
    assert breakdowns(table)["relative"] == {"m": {"all": {}}, "cv": {"all": {}}}


def test_one_recording_has_no_intervals():
    table = ScoreTable()
    add(table, 1.0, step_s=float("nan"))
    found = breakdowns(table)
    assert found["intervals"]["m"]["all"]["ade"] == [None, None]
    assert found["by_horizon"]["m"]["all"]["displacement_low"] == [None] * H
    assert found["by_horizon"]["m"]["all"]["time_s"] == [None] * H
    assert found["relative"]["m"]["all"] == {}


def test_a_path_without_covariance_has_no_calibration():
    table = ScoreTable()
    add(table, 2**0.5, model="ca", n=2, spread=None)
    found = breakdowns(table)
    assert found["reliability"]["ca"]["all"] == {}
    assert found["by_horizon"]["ca"]["all"]["nees"] == [None] * H
    assert found["by_horizon"]["ca"]["all"]["displacement"] == pytest.approx([2**0.5] * H)


def test_the_table_of_averages_has_a_row_for_each_model():
    lines = to_text(averages_table(filled().averages())).splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["m", "cv"]
    assert "ADE m" in lines[0]
    assert len({len(line) for line in lines}) == 1


def test_a_column_is_shown_if_one_model_has_a_value():
    table = ScoreTable()
    add(table, 1.0)
    add(table, 2.0, model="ca", spread=None)
    shown = averages_table(table.averages())
    place = list(shown.heads).index("ANLL") - 1
    assert [row.cells[place] for row in shown.rows][1] == "-"
    of_one = {"m": {"all": {"anll_kde": 1.0}}, "ca": {"all": {"anll_kde": None}}}
    assert "ANLL kde" in titles_of(of_one).values()
    assert "FNLL kde" not in titles_of(of_one).values()


def test_columns_without_a_value_are_left_out_of_the_table():
    table = filled()
    assert "moving 90% 5s" not in averages_table(table.averages()).heads  # the horizon is 1 s
    assert "moving 90% 1s" in averages_table(table.averages()).heads
    intervals = breakdowns(table)["intervals"]
    # 1 and 2 m off are within 2.15 standard deviations, 4 m are not.
    assert intervals["m"]["all"]["coverage_90_moving_1s"] == [1.0, 1.0]
    assert intervals["cv"]["all"]["coverage_90_moving_1s"] == [0.0, 0.0]
    assert intervals["m"]["all"]["coverage_90_moving_5s"] == [None, None]
