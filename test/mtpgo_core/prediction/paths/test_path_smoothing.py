# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Paths of consecutive cycles are combined for the same agent, mode and time, and only then."""

import numpy as np
import pytest

from mtpgo_core.prediction.paths.path_smoothing import KEEP_FACTOR, PathSmoother
from mtpgo_core.schema import AgentClass, HistoryWindow

M, H, T, DT = 2, 25, 16, 0.2
TIME = DT * np.arange(1, H + 1)
ALL = np.arange(2)
USABLE = np.ones(2, dtype=bool)
EQUAL = np.full((2, M), 1.0 / M)
ONES = np.ones(2)
SPREAD_M = 5.0


def window(stamp_s=0.0, *, keys=(1, 2), speed=(10.0, 10.0), classes=(1, 1), first=(0, 0)):
    """Two agents that move along +x; ``first`` is their first observed step."""
    n = len(keys)
    velocity = np.zeros((n, T, 2))
    velocity[:, :, 0] = np.array(speed)[:, None]
    key = np.zeros((n, 4), np.uint32)
    key[:, 0] = keys
    return HistoryWindow(
        stamp_ns=round(stamp_s * 1e9),
        frame_id="map",
        key=key,
        agent_class=np.array(classes, np.uint8),
        z=np.zeros(n),
        size=np.ones((n, 2)),
        position=np.zeros((n, T, 2)),
        velocity=velocity,
        acceleration=np.zeros((n, T, 2)),
        yaw=np.zeros((n, T)),
        valid=np.arange(T) >= np.array(first)[:, None],
        covariance=np.full((n, 6, 6), np.nan),
    )


def paths(speed=10.0, start=0.0, *, offset=0.0):
    """[2, M, H, 4] uniform motion of two agents along +x; the second mode is 1 m to the left."""
    mean = np.zeros((2, M, H, 4))
    mean[..., 0] = start + speed * TIME
    mean[..., 1] = offset + np.arange(M)[:, None]
    mean[..., 2] = speed
    return mean


def covariances(spread_m):
    """[2, M, H, 2, 2] the same in all directions and at all steps."""
    return np.broadcast_to(spread_m**2 * np.eye(2), (2, M, H, 2, 2))


def smooth(smoother, at, mean, usable=USABLE, weight=EQUAL, spread_m=SPREAD_M):
    agent, covariance = np.arange(len(at.key)), covariances(spread_m)
    return smoother.smooth(at, agent, mean, weight, covariance, usable, DT, ONES)[0]


def weights(smoother, at, mean, *first, temperature=ONES):
    """Return the weights of the first modes after a cycle in which they were ``first``."""
    first = np.array(first)
    given = np.stack((first, 1.0 - first), axis=1)
    agent, covariance = np.arange(len(at.key)), covariances(SPREAD_M)
    return smoother.smooth(at, agent, mean, given, covariance, USABLE, DT, temperature)[1][:, 0]


def test_the_first_cycle_is_as_given():
    mean = paths()
    assert smooth(PathSmoother(0.4), window(), mean) is mean


@pytest.mark.parametrize("elapsed_s", [0.2, 0.13, 0.5])
def test_paths_that_agree_are_not_changed(elapsed_s):
    smoother = PathSmoother(0.4)
    smooth(smoother, window(), paths())
    mean = paths(start=10.0 * elapsed_s)
    result = smooth(smoother, window(elapsed_s), mean)
    np.testing.assert_allclose(result, mean, atol=1e-9)


@pytest.mark.parametrize("elapsed_s", [0.2, 0.3, 30 / 29.97])
def test_a_step_is_followed_at_once_nearby_and_with_memory_far_away(elapsed_s):
    smoother = PathSmoother(0.4)
    smooth(smoother, window(), paths())
    mean = paths(start=10.0 * elapsed_s, offset=2.0)
    result = smooth(smoother, window(elapsed_s), mean)
    memory = np.exp(-elapsed_s / 0.4) * np.arange(1, H + 1) / H
    expected = np.broadcast_to(2.0 - 2.0 * memory, (2, H))
    np.testing.assert_allclose(result[:, 0, :, 1], expected, atol=1e-9)
    slope = np.gradient(result[0, 0, :, 1], DT)
    np.testing.assert_allclose(result[0, 0, :, 3], slope, atol=1e-9)
    np.testing.assert_allclose(result[..., 0], mean[..., 0], atol=1e-9)


@pytest.mark.parametrize(("spread_m", "combined"), [(0.94, True), (0.92, False)])
def test_a_path_that_ends_outside_the_new_ones_ellipse_is_news(spread_m, combined):
    """2 m aside; the 90 % ellipse ends at 2.146 standard deviations."""
    smoother = PathSmoother(0.4)
    smooth(smoother, window(), paths())
    mean = paths(start=2.0)
    mean[1, :, :, 1] += 2.0
    result = smooth(smoother, window(0.2), mean, spread_m=spread_m)
    np.testing.assert_allclose(result[0], mean[0], atol=1e-9)
    assert (result[1, 0, -1, 1] < 1.5) == combined
    assert combined or (result[1] == mean[1]).all()


def test_the_same_time_again_gives_the_same_result():
    smoother = PathSmoother(0.4)
    smooth(smoother, window(), paths())
    mean = paths(start=2.0, offset=2.0)
    once = smooth(smoother, window(0.2), mean)
    np.testing.assert_array_equal(smooth(smoother, window(0.2), mean), once)


def test_the_order_of_the_agents_does_not_matter():
    smoother, first = PathSmoother(0.4), paths()
    first[1, :, :, 1] += 100.0
    smooth(smoother, window(), first)
    mean = paths(start=2.0)
    mean[0, :, :, 1] += 100.0
    result = smooth(smoother, window(0.2, keys=(2, 1)), mean)
    np.testing.assert_allclose(result, mean, atol=1e-9)


@pytest.mark.parametrize(
    "later",
    [
        window(0.2, keys=(3, 4)),
        window(0.2, first=(15, 15)),
        window(0.2, speed=(0.1, 0.1)),
        window(0.2, speed=(np.nan, np.nan)),
        window(0.2, classes=(AgentClass.PEDESTRIAN, AgentClass.PEDESTRIAN)),
        window(1.4),
        window(-0.2),
    ],
    ids=["others", "restarted", "standing", "no velocity", "pedestrians", "pause", "earlier"],
)
def test_without_a_continuing_vehicle_paths_are_as_given(later):
    smoother = PathSmoother(0.4)
    smooth(smoother, window(), paths())
    mean = paths(start=2.0, offset=2.0)
    np.testing.assert_array_equal(smooth(smoother, later, mean), mean)
    assert weights(smoother, later, mean, 0.3, 0.6).tolist() == [0.3, 0.6]


@pytest.mark.parametrize(
    ("missing", "combined"),
    [
        ([[14], [14]], True),  # a delay of 0.2 to 0.4 s that is compensated
        ([[14, 13], [14, 13]], False),  # a gap that is not bridged
        ([[14], []], False),  # an agent that was lost alone
        ([[14, 13], [14]], False),
    ],
)
def test_before_a_compensated_delay_no_agent_has_samples(missing, combined):
    smoother, later = PathSmoother(0.4), window(0.2)
    for agent, steps in enumerate(missing):
        later.valid[agent, steps] = False
    smooth(smoother, window(), paths())
    mean = paths(start=2.0, offset=2.0)
    result = smooth(smoother, later, mean)
    assert (result[0, 0, -1, 1] < 1.5) == combined
    assert combined or (result[0] == mean[0]).all()


def test_the_heaviest_mode_remains_it_until_another_is_clearly_likelier():
    """0.49 and 0.44 of 1 in the next cycle, multiplied: 0.507 and 0.457."""
    smoother = PathSmoother(0.4)
    assert weights(smoother, window(), paths(), 0.6, 0.6).tolist() == [0.6, 0.6]
    found = weights(smoother, window(0.2), paths(start=2.0), 0.49, 0.44)
    kept = KEEP_FACTOR * np.array([0.49, 0.44])
    np.testing.assert_allclose(found, kept / (kept + np.array([0.51, 0.56])), rtol=1e-12)
    assert (found > 0.5).tolist() == [True, False]
    again = weights(smoother, window(0.4), paths(start=4.0), 0.49, 0.51)
    assert (again > 0.5).tolist() == [True, False]


def test_the_factor_is_that_of_the_calibrated_weights():
    """A calibration takes the root of the weights, and would take that of the factor as well."""
    smoother, temperature = PathSmoother(0.4), np.array([3.0, 0.5])
    weights(smoother, window(), paths(), 0.6, 0.6, temperature=temperature)
    found = weights(smoother, window(0.2), paths(start=2.0), 0.2, 0.4, temperature=temperature)
    odds = np.array([0.2, 0.4]) / np.array([0.8, 0.6])
    calibrated = (found / (1.0 - found)) ** (1.0 / temperature)
    np.testing.assert_allclose(calibrated, KEEP_FACTOR * odds ** (1.0 / temperature))


def test_weights_follow_their_agents():
    smoother = PathSmoother(0.4)
    weights(smoother, window(), paths(), 0.9, 0.2)
    found = weights(smoother, window(0.2, keys=(2, 1)), paths(start=2.0), 0.5, 0.5)
    np.testing.assert_allclose(
        found, [1.0 / (1.0 + KEEP_FACTOR), KEEP_FACTOR / (1.0 + KEEP_FACTOR)]
    )


def test_what_is_not_usable_is_not_remembered():
    smoother = PathSmoother(0.4)
    broken = paths()
    broken[0] = np.nan
    smooth(smoother, window(), broken, np.array([False, True]))
    mean = paths(start=2.0, offset=2.0)
    result = smooth(smoother, window(0.2), mean)
    np.testing.assert_array_equal(result[0], mean[0])
    assert np.isfinite(result).all()
    assert (result[1] != mean[1]).any()
