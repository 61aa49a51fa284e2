# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is served, and what is learned from, in a stream of observations."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.served_tables import apply_factors
from mtpgo_core.live_calibration.sigma_tracker import POOLS
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.schema import AgentClass, CalibrationStage, Source, tracked_states
from mtpgo_core.task.calibration import SIGMA_FACTOR_50_LIMITS
from mtpgo_core.task.task_description import HistoryConfig

MOVING, AGENTS, SPEED_MPS = 1, 8, 10.0
ONLINE = LiveOptions()
COVARIANCES_ONLY = LiveOptions(correct_paths=False)


class Road:
    """Cars at constant velocity, a model that errs sideways, and the live calibration.

    Attributes:
        served, shipped: the last prediction as published and as the model gave it.
        stated_mps: the velocity in the messages (m/s), by default the true one.
    """

    def __init__(self, options=ONLINE, offset_m=0.0, horizon_steps=25, shipped_50=1.0):
        self.shipped_50 = shipped_50
        config = HistoryConfig()
        self.history = TrackHistory(config)
        self.live = LiveCalibration(options, config, horizon_steps)
        self.horizon_steps = horizon_steps
        self.offset_m = offset_m
        self.stated_mps = SPEED_MPS
        self.step = 0

    def drive(self, seconds, *, jump=(), first_number=1, by_model=None):
        """Observe and predict every 0.2 s; cars whose index is in ``jump`` teleport."""
        for _ in range(round(seconds / 0.2)):
            x = 30.0 * np.arange(AGENTS) + SPEED_MPS * 0.2 * self.step
            x[list(jump)] += 500.0 * (self.step % 2)
            self.observe(x, first_number)
            self.predict(by_model)
            self.step += 1
        return self.served

    def observe(self, x, first_number=1):
        states = tracked_states(
            round((100.0 + 0.2 * self.step) * 1e9),
            "map",
            keys_from_integers(range(first_number, first_number + len(x))),
            np.stack([x, np.zeros(len(x))], axis=1),
            velocity=np.tile([self.stated_mps, 0.0], (len(x), 1)),
            agent_class=np.full(len(x), AgentClass.CAR, dtype=np.uint8),
        )
        self.live.observe(self.history, self.history.update(states))

    def predict(self, by_model=None):
        window = self.history.window()
        window = window.select(window.valid[:, -1])
        cv = predict_constant_velocity(window, horizon_steps=self.horizon_steps, dt_s=0.2, modes=2)
        mean = cv.mean.copy()
        source = np.full(len(cv), Source.MODEL, dtype=np.uint8)
        if by_model is not None:
            source[:] = np.where(by_model, Source.MODEL, Source.CONSTANT_VELOCITY)
        mean[source == Source.MODEL, ..., 1] += self.offset_m
        factor = np.ones((len(cv), self.horizon_steps))
        factor[source == Source.MODEL] = self.shipped_50
        self.shipped = dataclasses.replace(cv, mean=mean, source=source, sigma_factor_50=factor)
        self.served = self.live.serve(self.shipped, window)

    def sigma(self, source=Source.MODEL):
        """[H] learned factors of moving vehicles at 90 %."""
        return np.exp(self.live.tracker.log_sigma[source, 1, MOVING])


def variance_x(prediction):
    """[n, H] of the heaviest mode (m^2)."""
    return prediction.covariance[:, 0, :, 0, 0]


def test_without_path_correction_covariances_are_corrected_and_nothing_else():
    road = Road(COVARIANCES_ONLY, offset_m=5.0)
    served = road.drive(20.0)
    factor = np.sqrt(variance_x(served) / variance_x(road.shipped))
    assert (factor[:, :3] > 1.5).all()
    np.testing.assert_allclose(factor, np.broadcast_to(factor[0], factor.shape))
    for name in ("mean", "weight", "yaw", "source", "key", "initial"):
        np.testing.assert_array_equal(getattr(served, name), getattr(road.shipped, name))
    assert (served.calibration == CalibrationStage.ONLINE).all()
    assert (served.sigma_factor_50 > 0.0).all()


def test_the_factor_of_the_50_percent_ellipse_in_the_file_is_where_the_online_one_starts():
    road = Road(shipped_50=0.6)
    served = road.drive(0.2)
    np.testing.assert_allclose(served.sigma_factor_50, 0.6)
    half = np.array([False, True] * (AGENTS // 2))
    served = Road(shipped_50=0.6).drive(0.2, by_model=half)
    np.testing.assert_allclose(served.sigma_factor_50[half], 0.6)
    np.testing.assert_allclose(served.sigma_factor_50[~half], 1.0)


def test_the_50_percent_ellipse_is_learned_of_as_it_was_served():
    """Errors of 1.05 sigma: inside of the ellipse of a Gaussian (1.18), outside of 0.6 of it."""
    cv = Road()
    cv.drive(0.2)
    offset = 1.05 * np.sqrt(cv.shipped.covariance[0, 0, 0, 1, 1])
    wide, narrow = Road(offset_m=offset), Road(offset_m=offset, shipped_50=0.6)
    for road in (wide, narrow):
        road.drive(0.6)  # the first outcomes, one step ahead
    first = [road.live.tracker.log_sigma[Source.MODEL, 0, MOVING, 0] for road in (wide, narrow)]
    assert first[0] < 0.0 < first[1]


def test_the_ellipses_of_both_factors_together_lie_within_each_other():
    road = Road(shipped_50=1.3)
    road.drive(0.2)
    table = np.zeros_like(road.live.tracker.log_sigma)
    table[:, 0] = np.log(2.0)
    served = apply_factors(road.shipped, np.full(AGENTS, MOVING), table)
    np.testing.assert_allclose(served.sigma_factor_50, SIGMA_FACTOR_50_LIMITS[1])


@pytest.mark.parametrize("calibration", ["shipped", "off"])
def test_without_online_nothing_changes(calibration):
    road = Road(LiveOptions(calibration=calibration), offset_m=5.0)
    assert road.drive(10.0) is road.shipped


def test_a_factor_is_learned_at_its_own_time_ahead():
    road = Road(offset_m=5.0)
    road.drive(1.6)  # nothing is known of predictions beyond this time
    assert (road.sigma()[:4] != 1.0).all()
    assert (road.sigma()[8:] == 1.0).all()


def test_a_long_horizon_does_not_slow_down_what_is_learned_of_the_first_steps():
    """Of 30 s ahead the memory keeps a prediction each second, and learns from all of these."""
    usual = Road(offset_m=2.0)
    far = Road(offset_m=2.0, horizon_steps=150)
    for road in (usual, far):
        road.drive(10.0)
    gained = np.log(far.sigma()[:5]), np.log(usual.sigma()[:5])
    assert (gained[1] > 0.3).all()
    np.testing.assert_allclose(*gained, rtol=0.2)


def test_what_lies_far_ahead_is_learned_from():
    road = Road(offset_m=200.0, horizon_steps=150)
    road.drive(34.0)
    assert road.sigma()[140] > 1.1


def test_sigma_does_not_shrink_along_the_horizon_whatever_the_factors():
    road = Road()
    road.drive(0.2)
    table = np.zeros_like(road.live.tracker.log_sigma)
    table[:] = np.linspace(2.0, -1.5, 25)
    group = np.full(AGENTS, MOVING)
    served = apply_factors(road.shipped, group, table)
    size = np.linalg.det(served.covariance)
    assert (np.diff(size, axis=2) >= -1e-9 * size[:, :, 1:]).all()
    assert (np.linalg.eigvalsh(served.covariance) > 0.0).all()


def test_other_modes_are_narrowed_and_widened_less():
    road = Road()
    road.drive(0.2)
    table = np.zeros_like(road.live.tracker.log_sigma)
    table[:, :, :, :12], table[:, :, :, 12:] = np.log(0.5), np.log(4.0)
    served = apply_factors(road.shipped, np.full(AGENTS, MOVING), table)
    before, after = (p.covariance[..., 0, 0] for p in (road.shipped, served))
    factor = np.sqrt(after / before)
    np.testing.assert_allclose(factor[:, 0], np.tile([0.5] * 12 + [4.0] * 13, (AGENTS, 1)))
    np.testing.assert_allclose(factor[:, 1], np.tile([0.5**0.5] * 12 + [2.0] * 13, (AGENTS, 1)))


def test_agents_without_the_model_get_the_factors_of_constant_velocity():
    half = np.arange(AGENTS) < 4
    road = Road(offset_m=5.0)
    served = road.drive(20.0, by_model=half)
    factor = np.sqrt(variance_x(served) / variance_x(road.shipped))[:, 2]
    assert (factor[:4] > 1.5).all()
    assert (factor[4:] < 0.9).all()  # it was exact
    assert (road.sigma(Source.CONSTANT_VELOCITY)[:10] < 0.9).all()


def test_where_stated_velocities_are_too_large_constant_velocity_learns_that_it_misses():
    """3 m/s too much: after a second 3 m, more than four of its standard deviations."""
    road = Road()
    road.stated_mps = SPEED_MPS + 3.0
    road.drive(20.0, by_model=np.zeros(AGENTS, dtype=bool))
    assert (road.sigma(Source.CONSTANT_VELOCITY)[1:10] > 1.5).all()
    assert (road.sigma(Source.MODEL) == 1.0).all()


def test_what_is_not_confirmed_is_forgotten_in_the_time_of_the_stream():
    road = Road(LiveOptions(memory_s=20.0))
    road.live.tracker.log_sigma[:] = 1.0
    for road.step in range(51):
        road.observe(np.empty(0))
    any_moving = POOLS + MOVING
    left = road.live.tracker.log_sigma[:, :, any_moving]
    np.testing.assert_allclose(left, np.exp(-10.0 / 20.0))
    road.step += 500  # a pause of 100 s counts as 5 s
    road.observe(np.empty(0))
    left = road.live.tracker.log_sigma[:, :, any_moving]
    np.testing.assert_allclose(left, np.exp(-15.0 / 20.0))


def test_teleports_teach_nothing():
    calm, odd = Road(), Road()
    calm.drive(15.0)
    odd.drive(15.0, jump=range(AGENTS))
    assert (calm.sigma()[:10] < 0.95).all()
    assert (odd.sigma() == 1.0).all()


def test_a_clock_that_is_set_back_keeps_what_was_learned():
    road = Road()
    road.drive(15.0)
    learned = road.sigma()
    road.step = -500  # 100 s earlier: a new stream
    road.drive(0.8)
    np.testing.assert_allclose(road.sigma(), learned, rtol=0.1)
    road.drive(5.0)
    assert (road.sigma()[:3] <= learned[:3]).all()


def test_constant_velocity_is_preferred_and_the_model_watched_until_it_is_better():
    options = LiveOptions(prefer="best", prefer_time_s=5.0, prefer_agents=5, correct_paths=False)
    road = Road(options, offset_m=2.0)
    assert (road.drive(4.0).source == Source.MODEL).all()
    served = road.drive(8.0)
    assert (served.source == Source.PREFERRED_CONSTANT_VELOCITY).all()
    assert (served.mean[..., 1] == 0.0).all()
    assert (np.linalg.det(served.covariance[:, 0]) < np.linalg.det(road.shipped.covariance[:, 0]))[
        :, :10
    ].all()
    served = road.drive(12.0)
    assert (served.source == Source.PREFERRED_CONSTANT_VELOCITY).all()
    error_m = road.live.preference.error_m[MOVING]
    assert error_m[0] == pytest.approx(2.0, abs=0.1)
    assert error_m[1] == pytest.approx(0.0, abs=1e-6)


def test_preference_without_online_serves_constant_velocity_as_it_is():
    options = LiveOptions("shipped", prefer="best", prefer_time_s=5.0, prefer_agents=5)
    road = Road(options, offset_m=2.0)
    served = road.drive(12.0)
    assert (served.source == Source.PREFERRED_CONSTANT_VELOCITY).all()
    np.testing.assert_allclose(served.covariance, road.shipped.covariance)
    assert (served.calibration == CalibrationStage.NONE).all()
    assert (road.live.tracker.log_sigma == 0.0).all()


def test_predictions_that_were_served_as_shipped_are_learned_from_as_such():
    """Misses of 4.4 standard deviations, which ellipses four times as large would have held."""
    road = Road(LiveOptions("shipped", prefer="best"))
    road.stated_mps = SPEED_MPS + 3.0
    road.live.tracker.log_sigma[:] = np.log(4.0)
    by_model = np.zeros(AGENTS, dtype=bool)
    road.drive(3.0, by_model=by_model)
    road.live.configure(ONLINE)
    road.drive(0.2, by_model=by_model)
    assert road.sigma(Source.CONSTANT_VELOCITY)[4] > 4.0


def test_empty_scenes_and_agents_that_left_are_no_trouble():
    road = Road()
    road.drive(2.0)
    for _ in range(30):
        road.observe(np.empty(0))
        road.step += 1
    road.predict()
    assert len(road.served) == 0
    road.drive(2.0, first_number=100)
    assert len(select(road.served, np.arange(AGENTS))) == AGENTS


def test_a_prediction_of_another_horizon_is_left_alone():
    """After a swap of models, one of the earlier model may still be on its way."""
    road = Road()
    road.drive(1.0)
    window = road.history.window()
    window = window.select(window.valid[:, -1])
    short = predict_constant_velocity(window, horizon_steps=10, dt_s=0.2, modes=2)
    assert road.live.serve(short, window) is short
    assert (road.drive(1.0).calibration == CalibrationStage.ONLINE).all()
