# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores as statuses and as a text."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_core.quality.quality_report import SCORES, QualityLimits, QualityReport, judge
from mtpgo_core.task.calibration import GROUPS
from mtpgo_ros.quality.quality_statuses import group_statuses, overlay_text, summary_values

LIMITS = QualityLimits()
GOOD = {"ade": 1.0, "cv_ade": 2.0, "coverage_90": 0.9}


@pytest.fixture
def report():
    """Moving vehicles that are predicted badly, and three pedestrians."""
    scores = np.full((3, len(GROUPS), 3, len(SCORES)), 0.5)
    agents = np.zeros(scores.shape[:3], dtype=np.int64)
    for group, number in (("vehicle_moving", 20), ("pedestrian_moving", 3)):
        agents[:, GROUPS.index(group)] = number
    for name, value in GOOD.items():
        scores[..., SCORES.index(name)] = value
    scores[:, GROUPS.index("vehicle_moving"), 2, SCORES.index("coverage_90")] = 0.7
    return QualityReport(0, scores, agents, 25 * agents, 20 * agents, {"gap": 7})


def test_a_status_for_each_window_and_predicted_group(report):
    found = {status.name: status for status in group_statuses("predictor", report, LIMITS)}
    assert len(found) == 2 * 3
    vehicles = found["predictor: quality of moving vehicle in 5 min"]
    assert vehicles.level == DiagnosticStatus.WARN
    values = {pair.key: pair.value for pair in vehicles.values}
    assert values["ade_1s"] == "1.0000"
    assert values["agents_3s"] == "20"
    assert (values["predictions_3s"], values["by_model_3s"]) == ("500", "400")
    pedestrians = found["predictor: quality of moving pedestrian in 1 min"]
    assert pedestrians.level == DiagnosticStatus.OK
    values = {pair.key: pair.value for pair in pedestrians.values}
    assert values["scores_1s"] == "too few road users"
    assert "ade_1s" not in values


def test_the_summary_has_a_sentence_for_each_group_and_the_causes(report):
    values = summary_values(report, LIMITS, 300)
    assert values["vehicle_moving"] == "90 % ellipses hold 70 % of the true positions at 5 s"
    assert values["pedestrian_moving"] == "too few road users, 3 of 10 needed"
    assert values["no_truth_gap"] == "7"
    assert "vehicle_standing" not in values


def test_the_text_in_the_scene(report):
    lines = overlay_text(judge(report, LIMITS, 60), report, LIMITS, 60).splitlines()
    assert lines[0] == "WARN, last 1 min"
    assert lines[1].startswith("moving vehicle: ")
    assert len(lines) == 3
