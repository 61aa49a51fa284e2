# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The time of the model, and what is said where it is not enough."""

import pytest

from mtpgo_core.prediction.scene_predictor import PredictionReport
from mtpgo_ros.node.load_control import LoadControl, overload

PERIOD_NS = 200_000_000


def test_long_publications_shorten_the_budget_and_are_forgotten():
    control = LoadControl()
    assert control.budget_ns(0.85, PERIOD_NS) == 170_000_000
    control.published(50_000_000)
    assert control.budget_ns(0.85, PERIOD_NS) == 100_000_000
    control.published(10**9)
    assert control.budget_ns(0.85, PERIOD_NS) == 40_000_000
    for _ in range(100):
        control.published(1_000_000)
    assert control.budget_ns(0.85, PERIOD_NS) == 170_000_000


def test_the_model_has_less_than_the_budget():
    control = LoadControl()
    assert control.allowed_s(0.85, 0.2) == pytest.approx(0.95 * 0.17)
    control.published(20_000_000)
    assert control.allowed_s(0.85, 0.2) == pytest.approx(0.95 * 0.11)


def test_overload_is_reported_with_its_reason():
    assert overload(PredictionReport(agents=5, by_model=5, modes=8), 8) == ""
    report = PredictionReport(agents=5000, by_model=90, over_limit=4910, modes=2)
    said = overload(report, 8)
    assert "nearest 90 of 5000 agents" in said
    assert "max_agents is the limit" in said
    assert "2 of 8 modes" in said
    timed = PredictionReport(agents=200, by_model=90, over_limit=110, agent_limit=90, modes=8)
    assert overload(timed, 8) == (
        "the model predicts the nearest 90 of 200 agents, constant velocity the others: there is"
        " no time for more"
    )
