# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The verdict on the scores."""

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.quality.quality_report import (
    SCORES,
    WINDOWS_S,
    Level,
    QualityLimits,
    QualityReport,
    judge,
    judge_group,
)
from mtpgo_core.task.calibration import GROUPS

SHAPE = (len(WINDOWS_S), len(GROUPS), len(TIMES_S))
GOOD = {
    "ade": 1.0,
    "fde": 2.0,
    "miss_rate": 0.3,
    "nll": 1.0,
    "coverage_50": 0.5,
    "coverage_90": 0.9,
    "cv_ade": 1.5,
}


def report(agents=20, group="vehicle_moving", **scores):
    values = np.full((*SHAPE, len(SCORES)), np.nan)
    count = np.zeros(SHAPE, dtype=np.int64)
    place = (slice(None), GROUPS.index(group), 1)
    values[place] = [(GOOD | scores)[name] for name in SCORES]
    count[place] = agents
    return QualityReport(0, values, count, 25 * count, 25 * count, {})


@pytest.mark.parametrize(
    ("scores", "level", "words"),
    [
        ({}, Level.OK, "as good as the predictions say"),
        ({"ade": 1.4, "cv_ade": 1.5}, Level.OK, ""),
        (
            {"ade": 1.7, "cv_ade": 1.5},
            Level.WARN,
            "at 3 s, ADE 1.70 m to 1.50 m",
        ),
        ({"ade": 1.9, "cv_ade": 1.5}, Level.ERROR, "moving vehicle: worse than"),
        ({"ade": 0.09, "cv_ade": 0.01}, Level.OK, ""),  # harmless
        ({"coverage_90": 0.75}, Level.WARN, "90 % ellipses hold 75 %"),
        ({"coverage_90": 0.45}, Level.ERROR, "hold 45 %"),
        ({"coverage_90": 0.45, "ade": 1.7}, Level.ERROR, "1.50 m, 90 % ellipses hold 45 %"),
    ],
)
def test_the_level(scores, level, words):
    verdict = judge(report(**scores), QualityLimits(), 300)
    assert verdict.level == level
    assert words in verdict.message


def test_ellipses_that_are_too_small_at_several_times_are_one_sentence():
    early, later = report(coverage_90=0.75), report(coverage_90=0.03)
    place = (slice(None), GROUPS.index("vehicle_moving"))
    later.scores[(*place, 0)] = early.scores[(*place, 1)]
    later.agents[(*place, 0)] = 20
    verdict = judge(later, QualityLimits(), 300)
    assert verdict.level == Level.ERROR
    assert verdict.message == (
        "moving vehicle: 90 % ellipses hold 75, 3 % of the true positions at 1, 3 s"
    )


def test_too_few_agents_are_not_judged():
    verdict = judge(report(agents=9, coverage_90=0.0), QualityLimits(), 60)
    assert verdict.level == Level.OK
    assert verdict.message == (
        "too few road users to judge: at most 9 of a group in the last 1 min, 10 are needed"
    )
    assert judge(report(agents=9, coverage_90=0.0), QualityLimits(min_agents=9), 60).level == 2


def test_a_group_is_described():
    group = GROUPS.index("vehicle_moving")
    assert judge_group(report(), QualityLimits(), 300, group).message == (
        "moving vehicle: at 3 s ADE 1.00 m, constant velocity 1.50 m, 90 % ellipses hold 90 %, "
        "20 road users"
    )
    few = judge_group(report(agents=2), QualityLimits(), 300, group)
    assert few.message == "moving vehicle: too few road users, 2 of 10 needed"


def test_rows_hold_the_numbers_with_their_names():
    rows = report().rows(QualityLimits())
    assert len(rows) == np.prod(SHAPE)
    filled = rows[rows["agents"] > 0]
    assert filled["window_s"].tolist() == list(WINDOWS_S)
    assert set(filled["group"]) == {GROUPS.index("vehicle_moving")}
    assert set(filled["time_s"]) == {3}
    assert filled["coverage_90"].tolist() == [0.9] * 3
    assert np.isnan(report(agents=9).rows(QualityLimits())["ade"]).all()


def test_scores_of_too_few_agents_are_not_given():
    assert np.isnan(report(agents=9).trusted(QualityLimits())).all()
    assert np.isfinite(report(agents=10).trusted(QualityLimits())).any()


def test_the_limits_are_parameters():
    limits = QualityLimits(warn_coverage=0.95, error_coverage=0.92)
    assert judge(report(), limits, 60).level == Level.ERROR
    assert judge(report(ade=1.7), QualityLimits(error_cv_ratio=1.1), 60).level == Level.ERROR


def test_a_limit_that_is_none():
    with pytest.raises(ConfigurationError, match=r"quality\.min_agents is 0, expected"):
        QualityLimits(min_agents=0)
