# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The description of a model as text."""

from mtpgo_core.task.calibration import (
    GROUPS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
)
from mtpgo_core.task.task_description import SceneConfig, TaskDescription
from mtpgo_training.export.model_info import model_text


def lines(**fields):
    return model_text(TaskDescription(name="made", **fields)).splitlines()


def test_the_task_is_described_in_full():
    text = lines(version="1.2", weights_sha256="ab", model={"network": "lstm"})
    assert text[:6] == [
        "made (exported by version 1.2)",
        "network    lstm",
        "states     x, y, vx, vy",
        "horizon    25 steps of 0.2 s, 8 modes",
        "history    16 steps of 0.2 s",
        "scene      policy cover, frame centre_heading, up to 31 neighbours within 100 m",
    ]
    assert text[8:10] == ["weights    sha256 ab", "calibrated none"]
    unknown = lines()
    assert unknown[0] == "made (exported by version unknown)"
    assert unknown[1] == "network    mtp-go"


def test_a_least_spread_of_the_modes_is_described():
    expected = "horizon    25 steps of 0.2 s, 8 modes, spread by 0.7 sigma or more"
    assert lines(least_mode_spread=0.7)[3] == expected


def test_the_inputs_beside_the_features_are_described():
    assert "static     none: the network does not see the class" in lines()
    scene = SceneConfig(classes=("car", "bus"), sizes=True, trails=True)
    text = lines(scene=scene, model={"static_features": True})
    assert "static     class (car, bus), length, width, size_known" in text
    assert "trails     used: the ways of earlier road users" in text
    assert not any(line.startswith("trails") for line in lines())


def test_recordings_are_listed_by_use():
    uses = (("01", "train"), ("02", "test"), ("03", "train"))
    recordings = [{"source": "cars", "name": name, "split": use} for name, use in uses]
    assert lines(training={"recordings": recordings})[10:] == [
        "train      cars/01, cars/03",
        "validation -",
        "test       cars/02",
    ]


def test_the_runs_that_the_model_was_chosen_from_are_listed():
    runs = [{"seed": 1, "validation_ade_m": 0.5}, {"seed": 7, "validation_ade_m": 0.4}]
    assert lines(training={"chosen_from": runs, "licence": "free", "attribution": ""})[13:] == [
        "chosen     from 2 runs by validation ADE: 0.500 m (seed 1), 0.400 m (seed 7)",
        "licence    free",
    ]


def test_metrics_without_a_value_are_left_out():
    scores = {"ade": 0.51249, "n": 7, "fnll": None}
    assert lines(metrics={"validation": {"model": {"all": scores}}})[13:] == [
        "metrics    validation:",
        "           model  all     ade 0.512  n 7",
    ]


def test_the_calibration_and_the_coverage_of_moving_road_users_are_described():
    groups = tuple(
        GroupCalibration(name=name, factors=(1.0,) * 24 + (2.5,), temperature=1.5, agents=9)
        for name in GROUPS
    )
    calibration = Calibration(groups, (CalibrationSite("a", 5), CalibrationSite("b", 4)), True)
    scores = {"ade": 0.5, "moving_n": 60, "coverage_90_moving_5s": 0.875}
    scores["sites_coverage_90_moving_5s"] = 0.8
    metrics = {"validation": {"model": {"all": scores}}}
    text = lines(calibration=calibration, metrics=metrics)
    assert text[9] == "calibrated fitted to left-out sites: a (5), b (4)"
    assert " ".join(text[10].split()) == (
        "vehicle_standing covariance x 1 s 1.00 3 s 1.00 5 s 2.50 temperature 1.50 "
        "(9 agents, 0 sites)"
    )
    assert text[10 + len(GROUPS)] == (
        "coverage   validation: 0.875 of moving road users are inside their 90 % ellipse after "
        "5 s (60 predictions), in the mean of the sites 0.800"
    )
    assert text[-1] == "           model  all     ade 0.500"


def test_the_factors_of_the_50_percent_ellipses_are_described_where_there_are_any():
    groups = tuple(
        GroupCalibration(name=name, factors=(1.0,) * 25, sigma_factors_50=(0.5,) * 24 + (0.75,))
        for name in GROUPS
    )
    text = " ".join(lines(calibration=Calibration(groups))[10].split())
    assert "temperature 1.00 50 % ellipse x 0.50 0.50 0.75 (0 agents, 0 sites)" in text


def test_the_single_factor_of_an_earlier_version_is_described():
    assert lines(model={"covariance_scale": 1.683})[9] == (
        "calibrated one factor of 1.68 on all covariances"
    )
