# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration of predictions, alone and as the runner applies it."""

import dataclasses

import numpy as np
import pytest
from core_helpers import HORIZON, MODES, states_of, write_model

from mtpgo_core.errors import ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.calibrated_prediction import calibrate
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.paths.path_smoothing import KEEP_FACTOR, PathSmoother
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.schema import AgentClass, CalibrationStage
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_core.task.task_description import HistoryConfig, TaskDescription

SPEED_MPS = np.array([8.0, 0.0, 1.5, 4.0])
CLASSES = np.array(
    [AgentClass.CAR, AgentClass.CAR, AgentClass.PEDESTRIAN, AgentClass.UNKNOWN], dtype=np.uint8
)
FOUND = [GROUPS.index(f"{name}") for name in ("vehicle_moving", "vehicle_standing")]
FOUND += [GROUPS.index(f"{name}") for name in ("pedestrian_moving", "any_moving")]


def calibration(steps=HORIZON):
    """A calibration that is different for each group and step."""
    groups = (
        GroupCalibration(
            name=name,
            factors=tuple(1.0 + i + 0.1 * k for k in range(steps)),
            temperature=1.0 + 0.5 * i,
            sigma_factors_50=tuple(0.3 + 0.1 * i + 0.01 * k for k in range(steps)),
        )
        for i, name in enumerate(GROUPS)
    )
    return Calibration(groups=tuple(groups))


def window_after(cycles):
    history = TrackHistory(HistoryConfig())
    for k in range(cycles):
        position = np.stack([0.2 * k * SPEED_MPS, 20.0 * np.arange(4)], axis=1)
        velocity = np.stack([SPEED_MPS, np.zeros(4)], axis=1)
        history.update(
            states_of(0.2 * k, range(4), position, velocity=velocity, agent_class=CLASSES)
        )
    return history.window()


@pytest.fixture(scope="module")
def window():
    return window_after(6)


@pytest.fixture(scope="module")
def predictions(window, tmp_path_factory):
    """Of the same model without and with a calibration in its file."""
    folder = tmp_path_factory.mktemp("models")
    found = []
    for name, given in (("plain", Calibration()), ("calibrated", calibration())):
        write_model(folder / f"{name}.pt", 2, calibration=given)
        runner = ModelRunner.load(folder / f"{name}.pt")
        found.append(runner.predict(window, build_scenes(window, runner.task.scene)))
    return found


def test_the_runner_scales_covariances_by_group_and_step(predictions):
    plain, calibrated = predictions
    ratio = calibrated.covariance / np.where(plain.covariance == 0.0, np.nan, plain.covariance)
    for row, group in enumerate(FOUND):
        expected = 1.0 + group + 0.1 * np.arange(HORIZON)
        for mode in range(MODES):
            for axis in range(2):
                np.testing.assert_allclose(ratio[row, mode, :, axis, axis], expected)


def test_the_runner_changes_weights_by_temperature_and_keeps_means_and_order(predictions):
    plain, calibrated = predictions
    for row, group in enumerate(FOUND):
        expected = plain.weight[row] ** (1.0 / (1.0 + 0.5 * group))
        np.testing.assert_allclose(calibrated.weight[row], expected / expected.sum())
    assert (np.diff(calibrated.weight, axis=1) <= 0.0).all()
    np.testing.assert_array_equal(calibrated.mean, plain.mean)
    np.testing.assert_array_equal(calibrated.yaw, plain.yaw)


def test_the_runner_gives_the_factors_of_the_50_percent_ellipses(predictions):
    plain, calibrated = predictions
    assert (plain.sigma_factor_50 == 1.0).all()
    for row, group in enumerate(FOUND):
        expected = 0.3 + 0.1 * group + 0.01 * np.arange(HORIZON)
        np.testing.assert_allclose(calibrated.sigma_factor_50[row], expected)
    assert (calibrated.calibration == CalibrationStage.SHIPPED).all()


def test_a_smoother_keeps_the_heaviest_mode_by_a_factor_on_what_is_published(tmp_path):
    write_model(tmp_path / "m.pt", 2, calibration=calibration())
    runner, smoother = ModelRunner.load(tmp_path / "m.pt"), PathSmoother(0.4)

    def weights(cycles, smoother=None):
        window = window_after(cycles)
        scenes = build_scenes(window, runner.task.scene)
        return runner.predict(window, scenes, smoother=smoother).weight

    weights(6, smoother)
    kept, plain = weights(7, smoother), weights(7)
    car, pedestrian = 0, 2
    odds = [row[car, 0] / row[car, 1:].sum() for row in (kept, plain)]
    assert odds[0] / odds[1] == pytest.approx(KEEP_FACTOR)
    np.testing.assert_array_equal(kept[pedestrian], plain[pedestrian])


def test_a_velocity_that_was_never_known_counts_as_moving(predictions):
    plain, _ = predictions
    unknown = np.full((4, 2), np.nan)
    standing = dataclasses.replace(plain, initial=np.zeros((4, 4)))
    vehicle = GROUPS.index("vehicle_moving")
    variance = plain.covariance[0, 0, 0, 0, 0]
    found = calibrate(standing, calibration(), unknown).covariance[0, 0, 0, 0, 0]
    assert found == pytest.approx((1.0 + vehicle) * variance)
    found = calibrate(standing, calibration()).covariance[0, 0, 0, 0, 0]
    assert found == pytest.approx((1.0 + GROUPS.index("vehicle_standing")) * variance)


def test_rows_without_a_prediction_stay_so(predictions):
    plain, _ = predictions
    weight, covariance = plain.weight.copy(), plain.covariance.copy()
    weight[1] = covariance[1] = np.nan
    given = dataclasses.replace(plain, weight=weight, covariance=covariance)
    found = calibrate(given, calibration())
    assert np.isnan(found.weight[1]).all()
    assert np.isnan(found.covariance[1]).all()
    assert np.isfinite(found.weight[[0, 2, 3]]).all()


def test_without_a_calibration_the_prediction_is_the_same_object(predictions):
    plain, _ = predictions
    assert calibrate(plain, Calibration()) is plain


def test_a_weight_of_zero_stays_zero(predictions):
    plain, _ = predictions
    given = dataclasses.replace(plain, weight=np.tile([1.0, 0.0, 0.0], (4, 1)))
    np.testing.assert_array_equal(calibrate(given, calibration()).weight, given.weight)


def test_a_file_with_a_calibration_of_another_horizon_is_refused(tmp_path):
    write_model(tmp_path / "m.pt", 2, calibration=calibration(HORIZON + 1))
    with pytest.raises(ModelFileError, match=f"factors is {HORIZON + 1}, expected {HORIZON}"):
        ModelRunner.load(tmp_path / "m.pt")


def test_the_default_task_has_no_calibration():
    assert TaskDescription().calibration.is_none
