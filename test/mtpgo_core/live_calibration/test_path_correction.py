# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Paths are corrected by what became of earlier ones, in a stream of observations."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.path_equations import PathFit
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.schema import AgentClass, CalibrationStage, Source, tracked_states
from mtpgo_core.task.task_description import HistoryConfig

CARS = 8
SPEED_MPS = 10.0
STEPS = 25
ALONG = 0
AHEAD_S = 0.2 * np.arange(1, STEPS + 1)


class Road:
    """Cars at constant velocity and a model that lets each drift its own way.

    The heaviest mode leaves constant velocity by ``drift`` [cars, 2] (m/s, along and across), the
    other mode by twice that. So the errors are a linear function of the features.

    Attributes:
        served, shipped: the last prediction as published and as the model gave it.
        by_model: which cars it predicts.
        speed: [cars] (m/s).
        agent_class: [cars].
        first_number: of the identities.
        teleports: cars that jump to and fro.
        reversed_rows: the prediction has the cars in another order than the window.
    """

    def __init__(self, drift_mps=1.0, options=LiveOptions(), sigma_m=10.0):  # noqa: B008
        config = HistoryConfig()
        self.history, self.live = TrackHistory(config), LiveCalibration(options, config, STEPS)
        rng = np.random.default_rng(0)
        self.drift = drift_mps * rng.uniform(-1.0, 1.0, size=(CARS, 2))
        self.sigma_m = sigma_m
        self.by_model = np.ones(CARS, dtype=np.bool_)
        self.speed = np.full(CARS, SPEED_MPS)
        self.agent_class = np.full(CARS, AgentClass.CAR, dtype=np.uint8)
        self.first_number, self.teleports, self.step = 0, [], 0
        self.reversed_rows = False

    @property
    def key(self):
        return keys_from_integers(range(self.first_number, self.first_number + CARS))

    def drive(self, seconds):
        for _ in range(round(seconds / 0.2)):
            self.observe()
            self.predict()
            self.step += 1
        return self.served

    def observe(self):
        time_s = 100.0 + 0.2 * self.step
        x = 200.0 * np.arange(CARS) + self.speed * time_s
        x[self.teleports] += 500.0 * (self.step % 2)
        states = tracked_states(
            round(time_s * 1e9),
            "map",
            self.key,
            np.stack([x, np.zeros(CARS)], axis=1),
            velocity=np.stack([self.speed, np.zeros(CARS)], axis=1),
            agent_class=self.agent_class,
        )
        self.live.observe(self.history, self.history.update(states))

    def predict(self):
        window = self.history.window()
        # Those who were there a moment ago are still carried on.
        window = window.select(np.isin(sort_keys(window.key), sort_keys(self.key)))
        cv = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=2)
        mean = cv.mean.copy()
        for mode in range(2):
            drift = (mode + 1) * self.drift * self.by_model[:, None]
            mean[:, mode, :, :2] += drift[:, None] * AHEAD_S[:, None]
            mean[:, mode, :, 2:] += drift[:, None]
        covariance = np.zeros_like(cv.covariance) + self.sigma_m**2 * np.eye(2)
        self.shipped = dataclasses.replace(
            cv,
            mean=mean,
            covariance=covariance,
            weight=np.tile([0.7, 0.3], (CARS, 1)),
            source=np.where(self.by_model, Source.MODEL, Source.CONSTANT_VELOCITY).astype(
                np.uint8
            ),
            calibration=np.full(CARS, CalibrationStage.SHIPPED, dtype=np.uint8),
        )
        order = np.arange(CARS)[:: -1 if self.reversed_rows else 1]
        self.shipped = select(self.shipped, order)
        self.served = self.live.serve(self.shipped, window)

    def error_m(self, mode=0):
        """[cars] how far the served paths end from the truth (m)."""
        truth = self.shipped.initial[:, :2] + 5.0 * self.shipped.initial[:, 2:]
        return np.linalg.norm(self.served.mean[:, mode, -1, :2] - truth, axis=1)


def test_errors_that_can_be_foreseen_become_small():
    road = Road()
    road.drive(0.2)
    before = road.error_m()
    np.testing.assert_array_equal(road.served.mean, road.shipped.mean)  # nothing is known yet
    assert (road.served.calibration == CalibrationStage.ONLINE).all()
    served = road.drive(60.0)
    assert (road.error_m() < 0.15 * before).all()
    # The other mode is moved by as much less as only the heaviest follows the mean of both.
    assert (road.error_m(mode=1) < 2.0 * before).all()
    assert (served.calibration == CalibrationStage.ONLINE_PATH).all()
    for name in ("weight", "source", "key", "initial", "initial_yaw"):
        np.testing.assert_array_equal(getattr(served, name), getattr(road.shipped, name))
    # Velocities and directions are those of the corrected path.
    steps = np.diff(served.mean[..., :2], axis=2) / 0.2
    np.testing.assert_allclose(served.mean[:, :, 1:, 2:], steps, atol=1e-6)
    course = np.arctan2(served.mean[..., 3], served.mean[..., 2])
    np.testing.assert_allclose(served.yaw, course, atol=1e-9)


def test_the_order_of_a_prediction_does_not_matter():
    usual, other = Road(), Road()
    other.reversed_rows = True
    for road in (usual, other):
        road.drive(30.0)
    np.testing.assert_allclose(other.served.mean[::-1], usual.served.mean, atol=1e-9)


def test_paths_have_no_kinks_where_what_is_known_ends():
    """After 3 s nothing is known of what is farther ahead."""
    road = Road()
    served = road.drive(3.4)
    shift = served.mean[..., :2] - road.shipped.mean[..., :2]
    assert np.abs(shift[:, 0]).max() > 0.05
    whole = np.concatenate([np.zeros((CARS, 2, 1, 2)), shift], axis=2)
    # A cubic from 0 on: the fourth differences are 0.
    assert np.abs(np.diff(whole, 4, axis=2)).max() < 1e-6


def test_covariances_follow_the_corrected_paths():
    plain, corrected = (
        Road(options=LiveOptions(correct_paths=False), sigma_m=2.0),
        Road(sigma_m=2.0),
    )
    for road in (plain, corrected):
        road.drive(90.0)
    np.testing.assert_array_equal(plain.served.mean, plain.shipped.mean)
    assert (plain.served.calibration == CalibrationStage.ONLINE).all()
    ends = [road.served.covariance[:, 0, -1, 0, 0] for road in (plain, corrected)]
    assert (ends[1] < 0.8 * ends[0]).all()


@pytest.mark.parametrize("calibration", ["shipped", "off"])
def test_paths_stay_as_they_are_without_the_online_calibration(calibration):
    road = Road(options=LiveOptions(calibration, prefer="best"))
    np.testing.assert_array_equal(road.drive(30.0).mean, road.shipped.mean)
    assert not road.live.paths.equations.fit.coefficients.any()


def test_no_path_moves_by_more_than_a_standard_deviation_of_its_heaviest_mode():
    road = Road(drift_mps=2.0, sigma_m=0.5)
    road.drive(60.0)
    shift = road.served.mean[..., :2] - road.shipped.mean[..., :2]
    assert np.abs(shift).max() == pytest.approx(0.5, rel=0.02)


def test_what_stands_and_what_the_model_does_not_predict_stays_as_it_is():
    road = Road()
    road.by_model[:2] = False
    road.drive(60.0)
    moved = np.abs(road.served.mean - road.shipped.mean).max(axis=(1, 2, 3)) > 0.0
    assert moved.tolist() == [False] * 2 + [True] * 6
    stage = np.where(moved, CalibrationStage.ONLINE_PATH, CalibrationStage.ONLINE)
    np.testing.assert_array_equal(road.served.calibration, stage)

    road.speed[4:] = 0.4
    road.first_number += CARS  # others, or they would have braked within a moment
    road.observe()
    road.predict()
    moved = np.abs(road.served.mean - road.shipped.mean).max(axis=(1, 2, 3)) > 0.0
    assert moved.tolist() == [False] * 2 + [True] * 2 + [False] * 4


def test_who_is_not_moved_is_not_called_corrected():
    """Of pedestrians nothing is known yet, among cars of which much is."""
    road = Road()
    road.drive(30.0)
    road.agent_class[0] = AgentClass.PEDESTRIAN
    road.first_number += CARS
    road.drive(0.2)
    moved = np.abs(road.served.mean - road.shipped.mean).max(axis=(1, 2, 3)) > 0.0
    assert moved.tolist() == [False] + [True] * (CARS - 1)
    stage = np.where(moved, CalibrationStage.ONLINE_PATH, CalibrationStage.ONLINE)
    np.testing.assert_array_equal(road.served.calibration, stage)


def test_no_corrected_path_reverses():
    """Slow cars, on a road where all that was learned is that cars are slower by 2 m/s."""
    road = Road(drift_mps=0.2)
    road.speed[:] = 1.5
    fit = road.live.paths.equations.fit
    coefficients, belief = np.zeros_like(fit.coefficients), np.zeros_like(fit.belief)
    coefficients[:, ALONG, :, -1], belief[:, ALONG] = -2.0 * AHEAD_S, 1.0
    information = np.broadcast_to(1e9 * np.eye(fit.coefficients.shape[-1]), fit.information.shape)
    road.live.paths.equations.begin_with(PathFit.begun(coefficients, belief, information))
    served = road.drive(0.2)
    assert (served.mean[..., -1, 0] < road.shipped.mean[..., -1, 0] - 1.0).all()
    start = np.broadcast_to(served.initial[:, None, None, 0], (CARS, 2, 1))
    assert np.diff(np.concatenate([start, served.mean[..., 0]], axis=2)).min() > -1e-9


def test_only_the_outcomes_of_the_same_track_teach():
    """A teleport ends a track, and another one with the same identity begins."""
    lost = Road()
    lost.teleports = list(range(CARS))
    lost.drive(20.0)
    assert not lost.live.paths.equations.fit.coefficients.any()
    calm, odd = Road(), Road()
    odd.teleports = [1, 2, 3]
    for one in (calm, odd):
        one.drive(20.0)
    found = [one.live.paths.equations.fit.coefficients for one in (calm, odd)]
    assert np.abs(found[0] - found[1]).max() < 0.3 * np.abs(found[0]).max()


def test_after_a_reset_of_the_clock_what_was_learned_serves_on():
    road = Road()
    road.drive(30.0)
    learned = road.live.paths.equations.fit
    road.step = 0
    road.observe()
    road.predict()
    assert (road.served.calibration == CalibrationStage.ONLINE_PATH).all()
    assert road.live.paths.equations.fit is learned
    road.live.clear_stream("frame_changed")
    road.drive(6.0)
    assert np.isfinite(road.live.paths.equations.fit.coefficients).all()


def test_one_impossible_error_counts_as_three_standard_deviations():
    sensible, wild = Road(sigma_m=1.0), Road(sigma_m=1.0)
    wild.drift[0] = [0.0, 200.0]
    sensible.drift[0] = [0.0, 200.0]
    sensible.by_model[0] = False
    for road in (sensible, wild):
        road.drive(30.0)
    found = [road.error_m()[1:].mean() for road in (sensible, wild)]
    assert found[1] < 2.0 * found[0] + 0.5


class NoisyRoad(Road):
    """Thirty cars as a tracker reports them, whose noise lasts, the last one erratically.

    The model is constant velocity, so what can be learned is how much of a velocity is noise.

    Attributes:
        erratic: the velocity of the last car is never right.
        errors: of the other cars, [29, H] by prediction, as served and as shipped (m).
    """

    cars, noise_s = 30, 2.0

    def __init__(self, erratic):
        super().__init__(drift_mps=0.0)
        self.erratic, self.errors = erratic, []
        self.random = np.random.default_rng(2)
        self.noise = self.random.normal(size=(self.cars, 4))

    def drive(self, seconds):
        kept = np.exp(-0.4 / self.noise_s)
        for _ in range(round(seconds / 0.4)):
            time_s = 0.4 * self.step
            fresh = self.random.normal(size=self.noise.shape)
            self.noise = kept * self.noise + np.sqrt(1.0 - kept**2) * fresh
            truth = np.stack([20.0 * np.arange(self.cars) + 10.0 * time_s, np.zeros(self.cars)], 1)
            velocity = np.array([10.0, 0.0]) + 0.5 * self.noise[:, 2:]
            if self.erratic:
                velocity[-1] += 12.0 * np.array([np.cos(time_s), np.sin(time_s)])
            states = tracked_states(
                10**18 + round(time_s * 1e9),
                "map",
                keys_from_integers(range(self.cars)),
                truth + 0.2 * self.noise[:, :2],
                velocity=velocity,
                agent_class=np.full(self.cars, AgentClass.CAR, dtype=np.uint8),
            )
            self.live.observe(self.history, self.history.update(states))
            window = self.history.window()
            cv = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=2)
            covariance = (0.1 + AHEAD_S**2)[:, None, None] * np.eye(2)
            shipped = dataclasses.replace(
                cv,
                covariance=np.broadcast_to(covariance, cv.covariance.shape).copy(),
                weight=np.tile([0.7, 0.3], (self.cars, 1)),
                source=np.full(self.cars, Source.MODEL, dtype=np.uint8),
            )
            served = self.live.serve(shipped, window)
            ends = truth[:, None] + np.stack([10.0 * AHEAD_S, 0.0 * AHEAD_S], axis=1)
            paths = [one.mean[:, 0, :, :2] - ends for one in (served, shipped)]
            self.errors.append(np.linalg.norm(paths, axis=-1)[:, :-1].mean(axis=-1))
            self.step += 1


def test_one_erratic_car_of_thirty_does_not_make_the_paths_of_the_others_worse():
    calm, odd = NoisyRoad(erratic=False), NoisyRoad(erratic=True)
    for road in (calm, odd):
        road.drive(60.0)
        served, shipped = np.array(road.errors).transpose(1, 0, 2)  # [predictions, 29]
        for first in range(0, 150, 25):
            part = slice(first, first + 25)
            assert served[part].mean() < 1.05 * shipped[part].mean()
    last = [np.array(road.errors)[75:].mean(axis=(0, 2)) for road in (calm, odd)]
    assert last[0][0] < 0.75 * last[0][1]
    assert last[1][0] < 0.85 * last[1][1]


def test_empty_scenes_are_no_trouble():
    road = Road()
    window = road.history.window()
    empty = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=2)
    assert len(road.live.serve(empty, window)) == 0
    road.by_model[:] = False
    road.drive(10.0)
    assert not road.live.paths.equations.fit.coefficients.any()
