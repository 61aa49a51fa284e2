# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the live calibration promises, over DDS and in simulated time that runs fast.

Minutes of stamps pass in seconds. The numbers are those that a user sees: the covariances of the
predictions, the coverage in ``~/quality`` and the factors in ``/diagnostics``.
"""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from ros_helpers import START_NS, Bench, message_of
from rosgraph_msgs.msg import Clock

from msg_adapters.conversions import make_time
from msg_adapters.types import RclpyTypes
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, Source, tracked_states

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
DT_S, TIMES_S = 0.4, (1, 3, 5)
"""Time between observations (s), as far apart as predictions that are learned from."""

SHIPPED_VARIANCE = 0.1 + (0.2 * np.arange(1, 26)) ** 2
"""[H] of the tiny model (m^2)."""

EACH, DRIFT_MPS, PREFER_S = 6, 3.0, 4.0
"""Cars, and as many pedestrians; drift of the model ``wrong``; the parameter ``prefer_time``."""

CARS, ERRATIC, CALM_S = 30, 29, 60.0
COVARIANCES = {"max_modes": 1, "correct_paths": False}
"""Parameters of a node that learns covariances alone."""

CORRELATION_S, POSITION_NOISE_M, VELOCITY_NOISE_MPS = 2.0, 0.2, 0.5
"""Of a tracker: its errors last for some time."""


class NoisyTracker:
    """Cars at 10 m/s as a tracker reports them, whose noise is the same in each stream."""

    def __init__(self):
        self.random = np.random.default_rng(2)
        self.error = self.random.normal(size=(CARS, 4))
        self.step = 0

    def observe(self, *, noise=1.0, erratic=False):
        """Return the next states; with the erratic car, whose velocity is never right."""
        time_s = DT_S * self.step
        keep = np.exp(-DT_S / CORRELATION_S) if self.step else 1.0
        fresh = self.random.normal(size=self.error.shape)
        self.error = keep * self.error + np.sqrt(1.0 - keep**2) * fresh
        self.step += 1
        position = np.stack([20.0 * np.arange(CARS) + 10.0 * time_s, np.zeros(CARS)], axis=1)
        position += noise * POSITION_NOISE_M * self.error[:, :2]
        velocity = [10.0, 0.0] + noise * VELOCITY_NOISE_MPS * self.error[:, 2:]
        velocity[ERRATIC] += 12.0 * np.array([np.cos(time_s), np.sin(time_s)])
        return states(time_s, position, velocity, rows=slice(CARS if erratic else ERRATIC))


def steps(seconds):
    """Return the number of observations in a time."""
    return round(seconds / DT_S)


def states(time_s, position, velocity, kinds=AgentClass.CAR, rows=slice(None)):
    n = len(position)
    return tracked_states(
        START_NS + round(time_s * 1e9),
        "map",
        keys_from_integers(range(1, n + 1))[rows],
        position[rows],
        agent_class=np.full(n, kinds, dtype=np.uint8)[rows],
        velocity=velocity[rows],
        yaw=np.zeros(n)[rows],
    )


class FastBench(Bench):
    """A test bench in simulated time.

    Attributes:
        people: what comes on ``~/quality``.
    """

    def __init__(self, model, **parameters):
        super().__init__(
            model, use_sim_time=True, output=["pointcloud2"], diagnostic_period=1.0, **parameters
        )
        self.people = []
        self.peer.create_subscription(DiagnosticArray, "predictor/quality", self.people.append, 20)
        self.clock = self.peer.create_publisher(Clock, "/clock", 20)
        self.start().be_patient()
        self.until(lambda: self.clock.get_subscription_count() > 0)

    def drive(self, observed):
        """Let the clock go on to the states' time, and return their prediction."""
        stamp_ns = observed.stamp_ns
        self.clock.publish(Clock(clock=make_time(RclpyTypes(), stamp_ns)))
        self.until(lambda: self.node.get_clock().now().nanoseconds >= stamp_ns)
        self.send(message_of(observed))
        self.until(lambda: self.predictions and self.predictions[-1].stamp_ns == stamp_ns)
        return self.predictions[-1]

    def diagnosed(self, name):
        """Return level and values of a status of ``/diagnostics`` that is made now."""
        for _ in range(2):  # the first one may have been on its way
            self.statuses.clear()
            self.until(lambda: name in self.statuses)
        return self.statuses[name].level, {p.key: p.value for p in self.statuses[name].values}

    def minute(self, group):
        """Return what ``~/quality`` says about a group in the minute before the last stamp."""
        last = make_time(RclpyTypes(), self.predictions[-1].stamp_ns)
        self.until(lambda: self.people and self.people[-1].header.stamp == last)
        name = f"quality of moving {group} in 1 min"
        found = next(one for one in self.people[-1].status if one.name.endswith(name))
        return {pair.key: pair.value for pair in found.values}


def coverage(bench):
    """Return the shares of cars inside the 90 % ellipses after 1, 3 and 5 s."""
    values = bench.minute("vehicle")
    return np.array([float(values[f"coverage_90_{t}s"]) for t in TIMES_S])


def factors(prediction):
    """Return [2, H] factors on sigma of the 50 % and the 90 % ellipses, as they were served."""
    most = np.sqrt(prediction.covariance[0, 0, :, 0, 0] / SHIPPED_VARIANCE)
    return np.stack([prediction.sigma_factor_50[0] * most, most])


def shown(bench):
    """Return all factors in the diagnostics."""
    _, values = bench.diagnosed("calibration")
    keys = [key for key in values if "_sigma_" in key]
    found = {key: np.array(values[key].split(), dtype=float) for key in keys}
    assert {key.split("_sigma_")[0] for key in found} == {"model", "constant_velocity"}
    return found


@pytest.fixture(scope="module")
def calm(models):
    """A node that has seen 29 cars; the bench, the tracker, factors by cycle, and those shown."""
    bench, tracker = FastBench(models["quick"], **COVARIANCES), NoisyTracker()
    served = [factors(bench.drive(tracker.observe())) for _ in range(steps(CALM_S))]
    yield bench, tracker, served, shown(bench)
    bench.close()


def test_one_erratic_car_of_thirty_moves_no_factor_by_a_tenth(calm, models):
    _, _, without, shown_without = calm
    bench, tracker = FastBench(models["quick"], **COVARIANCES), NoisyTracker()
    try:
        served = [bench.drive(tracker.observe(erratic=True)) for _ in without]
        shown_with = shown(bench)
        missed = float(bench.minute("vehicle")["miss_rate_1s"])
    finally:
        bench.close()
    assert missed == pytest.approx(1 / CARS, rel=0.1)  # the erratic car always, the others never
    assert all(len(one) == CARS and (one.source == Source.MODEL).all() for one in served)
    ratio = np.array([factors(one) for one in served]) / without
    assert 0.01 < np.abs(np.log(ratio)).max() < np.log(1.1)
    assert shown_with.keys() == shown_without.keys()
    for key, values in shown_without.items():
        np.testing.assert_allclose(shown_with[key], values, rtol=0.1, err_msg=key)


def test_noise_that_doubles_is_followed_within_a_minute(calm):
    bench, tracker, _, before = calm
    assert (coverage(bench) > 0.87).all()
    for _ in range(steps(60.0)):
        bench.drive(tracker.observe(noise=2.0))
    after = shown(bench)
    assert (coverage(bench) < 0.87).all()  # not at once
    for _ in range(steps(60.0)):
        bench.drive(tracker.observe(noise=2.0))
    assert coverage(bench) == pytest.approx(0.9, abs=0.03)
    for level in (50, 90):
        key = f"model_sigma_{level}_vehicle_moving"
        assert after[key] / before[key] == pytest.approx(2.0, rel=0.2)


class OneSidedTracker:
    """Cars and pedestrians, of whose velocities a tracker reports the forward part only.

    The model ``wrong`` expects all to drift to the left at 3 m/s as well. The pedestrians do. The
    cars do when they are told to.
    """

    def __init__(self):
        self.step, self.drift_m = 0, 0.0

    def observe(self, *, drift):
        time_s, row = DT_S * self.step, np.arange(EACH)
        self.step += 1
        self.drift_m += drift * DRIFT_MPS * DT_S
        cars = np.stack([20.0 * row + 10.0 * time_s, np.full(EACH, self.drift_m)], axis=1)
        left_m = np.full(EACH, 50.0 + DRIFT_MPS * time_s)
        pedestrians = np.stack([20.0 * row + 1.5 * time_s, left_m], axis=1)
        return states(
            time_s,
            np.concatenate([cars, pedestrians]),
            np.repeat([[10.0, 0.0], [1.5, 0.0]], EACH, axis=0),
            np.repeat([AgentClass.CAR, AgentClass.PEDESTRIAN], EACH),
        )


def test_best_serves_constant_velocity_only_where_and_while_it_is_better(models):
    bench = FastBench(
        models["wrong"],
        prefer="best",
        prefer_time=PREFER_S,
        prefer_agents=EACH,
        path_smoothing=0.0,
        correct_paths=False,  # or the model would soon be right
    )
    tracker = OneSidedTracker()
    try:
        served = [bench.drive(tracker.observe(drift=False)) for _ in range(steps(12.0))]
        level, values = bench.diagnosed("calibration")
        assert level == WARN
        assert bench.statuses["calibration"].message.endswith("and serves vehicle_moving")
        assert values["served_by_vehicle_moving"] == "constant velocity"
        assert values["served_by_pedestrian_moving"] == "model"
        scored = bench.minute("vehicle")
        assert 0 < int(scored["by_model_1s"]) < int(scored["predictions_1s"])
        turned = len(served)
        served += [bench.drive(tracker.observe(drift=True)) for _ in range(steps(24.0))]
        level, values = bench.diagnosed("calibration")
        assert level == OK
        assert values["served_by_vehicle_moving"] == "model"
        assert values["served_by_pedestrian_moving"] == "model"
    finally:
        bench.close()
    source = np.array([one.source for one in served])
    assert (source[:, EACH:] == Source.MODEL).all()
    assert (source[:, :EACH] == source[:, :1]).all()
    first, back = np.flatnonzero(np.diff(source[:, 0])) + 1
    assert set(source[first:back, 0]) == {Source.PREFERRED_CONSTANT_VELOCITY}
    assert source[0, 0] == source[-1, 0] == Source.MODEL
    assert PREFER_S < DT_S * first < PREFER_S + 2.0
    # The averages of the time before have to fade, the new errors to become known.
    assert PREFER_S < DT_S * (back - turned) < 4.0 * PREFER_S
    by_model = source[:, 0] == Source.MODEL
    sideways_m = np.array([one.mean[0, 0, -1, 1] - one.mean[0, 0, 0, 1] for one in served])
    assert sideways_m == pytest.approx(np.where(by_model, 4.8 * DRIFT_MPS, 0.0), abs=1e-3)
    weights = np.array([one.weight[0] for one in served])
    expected = np.where(by_model[:, None], [0.5, 0.3, 0.2], [1.0, 0.0, 0.0])
    assert weights == pytest.approx(expected, abs=1e-6)
