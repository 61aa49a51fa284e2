# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The plain data of a honesty table."""

import json

import pytest
from known_paths import agents, paths

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.honesty.honesty_summary import BREAKDOWNS, honesty_summary
from mtpgo_training.evaluation.honesty.honesty_table import HonestyTable


@pytest.fixture(scope="module")
def content():
    table = HonestyTable()
    for k in range(4):
        cars = agents(3, 0.2 * k)
        weight = (0.8, 0.2)
        table.add("m", "all", cars, paths(cars, error_m=3.0, apart_m=-3.0, weight=weight))
        table.add("cv", "all", cars, paths(cars, error_m=0.5 * k, sigma_m=None))
        walkers = agents(2, 0.2 * k, kind=AgentClass.PEDESTRIAN, speed=0.0, first=3)
        table.add("m", "all", walkers, paths(walkers, weight=weight))
    return honesty_summary(table)


def test_it_is_json_with_all_breakdowns(content):
    assert json.loads(json.dumps(content, allow_nan=False)) == content
    assert set(content) == {"m", "cv"}
    own = content["m"]["all"]
    assert set(own) == {"all", *BREAKDOWNS}
    assert own["all"]["n"] == 20
    assert set(own["by_class_group_and_motion"]) == {"vehicle, moving", "pedestrian, standing"}
    assert set(own["by_speed"]) == {"0-1", "5-15"}
    assert own["by_since_start_and_motion"]["0-20, moving"] == own["by_motion"]["moving"]
    assert own["by_class"]["car"] == own["by_motion"]["moving"]


def test_sharpness_and_error_stand_side_by_side(content):
    spread = content["m"]["all"]["by_motion"]["moving"]["spread"]
    assert spread["time_s"] == [1, 2, 3, 4, 5]
    assert spread["rmse"] == pytest.approx([3.0] * 5)
    assert spread["sigma"] == pytest.approx([2**0.5] * 5)
    assert spread["ratio"] == pytest.approx([2**0.5 / 3.0] * 5)
    standing = content["m"]["all"]["by_motion"]["standing"]["spread"]
    assert standing["rmse"] == [0.0] * 5
    assert standing["ratio"] == [None] * 5


def test_coverage_weights_and_diversity(content):
    values = content["m"]["all"]["by_motion"]["moving"]
    assert values["time_s"] == [1, 3, 5]
    assert values["ellipse_95"] == [0.0] * 3
    assert values["region_95"] == [1.0] * 3
    weights = values["weights"]
    assert (weights["heaviest_nearest"], weights["chance"]) == (0.0, 0.5)
    assert weights["calibration_error"] == pytest.approx(0.8)
    assert weights["reliability"]["count"] == [0, 0, 12, 0, 0, 0, 0, 0, 12, 0]
    assert weights["reliability"]["nearest"][2] == 1.0
    assert weights["reliability"]["weight"][0] is None
    assert values["diversity"]["mode_distance"] == pytest.approx(2 * 0.16 * 3.0)


def test_jumps_have_mean_and_quantile_and_missing_values_are_none(content):
    values = content["cv"]["all"]["all"]
    assert values["consistency"]["jump"] == pytest.approx(0.5)
    assert values["consistency"]["jump_95"] == pytest.approx(0.5)
    assert (values["consistency"]["n"], values["consistency"]["cycle_s"]) == (
        9,
        pytest.approx(0.2),
    )
    assert values["ellipse_90"] == values["nll"] == [None] * 3
    assert values["weights"]["brier"] is None
    assert values["feasibility"]["creep"] is None
    assert values["feasibility"]["reverses"] == 0.0


def test_one_instant_has_no_jumps_and_nothing_gives_nothing():
    table = HonestyTable()
    table.add("m", "all", agents(1), paths(agents(1)))
    consistency = honesty_summary(table)["m"]["all"]["all"]["consistency"]
    assert {consistency[key] for key in ("cycle_s", "jump", "jump_95", "mixture_jump_95")} == {
        None
    }
    assert honesty_summary(HonestyTable()) == {}
