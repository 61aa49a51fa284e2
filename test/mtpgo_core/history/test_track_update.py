# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rules by which observations update tracks, by hand-worked numbers."""

import math

import numpy as np
import pytest
from core_helpers import S_NS, states_of

from mtpgo_core.history.resampling import Brackets
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.history.track_store import ACCELERATION, POSITION, VELOCITY, YAW, TrackStore
from mtpgo_core.history.track_update import (
    complete_samples,
    extrapolate_covariance,
    interpolate,
    moved_impossibly,
    usable_observations,
)
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.task.task_description import HistoryConfig

NAN = np.nan
CONFIG = HistoryConfig()


def track_store(config=CONFIG, tracks=1):
    """A store and the slots of some tracks without samples."""
    store = TrackStore(config, 10, config.keep_ns)
    slot, _ = store.allocate(
        sort_keys(keys_from_integers(range(tracks))), np.empty(0, dtype=np.intp)
    )
    return store, slot


def add(store, slot, states, config=CONFIG):
    """Add observations as the history does; return the samples."""
    rows = np.arange(len(states))
    sample = complete_samples(config, store, slot, states.stamp_ns, states, rows)
    store.rings.append(slot, states.stamp_ns, sample)
    return sample


def test_usable_positions_and_speeds():
    states = states_of(
        0.0,
        range(6),
        [[1.0, 2.0], [NAN, 0.0], [0.0, 1.1e8], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
        velocity=[[0, 0], [0, 0], [0, 0], [60.0, 80.1], [60.0, 80.0], [1e9, NAN]],
    )
    finite, too_fast = usable_observations(CONFIG, states)
    assert finite.tolist() == [True, False, False, True, True, True]
    # 100.08 m/s is too fast, 100 m/s is not; a velocity that is partly unknown is no speed.
    assert too_fast.tolist() == [False, False, False, True, False, False]


@pytest.mark.parametrize(("moved_m", "impossible"), [(44.9, False), (45.1, True)])
def test_without_a_known_velocity_the_highest_speed_limits_the_move(moved_m, impossible):
    store, slot = track_store()
    add(store, slot, states_of(0.0, [0], [[10.0, 0.0]]))
    # 5 m + 100 m/s * 0.4 s = 45 m
    position = np.array([[10.0, moved_m]])
    found = moved_impossibly(CONFIG, store, slot, round(0.4 * S_NS), position)
    assert found.tolist() == [impossible]


@pytest.mark.parametrize(("off_m", "impossible"), [(7.3, False), (7.5, True)])
def test_with_a_known_velocity_the_deviation_from_it_is_limited(off_m, impossible):
    store, slot = track_store()
    for k in range(4):
        add(store, slot, states_of(0.1 * k, [0], [[1.0 * k, 0.0]]))
    # At 10 m/s from x = 3 m, 0.4 s later: x = 7 m; 5 m + 15 m/s^2 * (0.4 s)^2 = 7.4 m
    position = np.array([[7.0, off_m]])
    found = moved_impossibly(CONFIG, store, slot, round(0.7 * S_NS), position)
    assert found.tolist() == [impossible]


def test_missing_values_of_a_first_observation():
    store, slot = track_store(tracks=2)
    states = states_of(0.0, [0, 1], [[1, 2], [3, 4]], velocity=[[NAN, NAN], [0.0, 3.0]])
    sample = add(store, slot, states)
    assert sample[:, POSITION].tolist() == [[1, 2], [3, 4]]
    assert np.isnan(sample[0, VELOCITY]).all()
    assert sample[1, VELOCITY].tolist() == [0.0, 3.0]
    # The prior of the acceleration is zero, once there is a velocity.
    assert np.isnan(sample[0, ACCELERATION]).all()
    assert sample[1, ACCELERATION].tolist() == [0.0, 0.0]
    # Without a yaw, the direction of motion.
    assert np.isnan(sample[0, YAW])
    assert sample[1, YAW] == pytest.approx(math.pi / 2)


def test_the_velocity_is_estimated_from_positions_where_the_message_has_none():
    store, slot = track_store()
    add(store, slot, states_of(0.0, [0], [[0.0, 0.0]], velocity=[[7.0, 0.0]]))
    sample = add(store, slot, states_of(0.2, [0], [[2.0, -1.0]]))
    # Two samples determine the line: (2, -1) m in 0.2 s.
    assert sample[0, VELOCITY] == pytest.approx([10.0, -5.0])
    assert store.position_velocity[slot][0] == pytest.approx([10.0, -5.0])
    assert sample[0, YAW] == pytest.approx(math.atan2(-5.0, 10.0))


def test_a_given_velocity_never_changes_the_estimate_from_positions():
    store, slot = track_store()
    add(store, slot, states_of(0.0, [0], [[0.0, 0.0]], velocity=[[7.0, 0.0]]))
    sample = add(store, slot, states_of(0.2, [0], [[2.0, 0.0]], velocity=[[7.0, 0.0]]))
    assert sample[0, VELOCITY].tolist() == [7.0, 0.0]
    assert store.position_velocity[slot][0] == pytest.approx([10.0, 0.0])


def test_a_given_acceleration_is_used_if_configured_and_plausible():
    config = HistoryConfig(acceleration_source="message")
    store, slot = track_store(config, tracks=3)
    given = [[1.0, -2.0], [201.0, 0.0], [NAN, 0.0]]
    states = states_of(
        0.0, range(3), np.zeros((3, 2)), velocity=np.ones((3, 2)), acceleration=given
    )
    sample = add(store, slot, states, config)
    assert sample[:, ACCELERATION].tolist() == [[1.0, -2.0], [0.0, 0.0], [0.0, 0.0]]
    # By default the message's acceleration is ignored.
    store, slot = track_store(tracks=3)
    assert add(store, slot, states)[:, ACCELERATION].tolist() == [[0.0, 0.0]] * 3


def test_the_yaw_is_wrapped_and_kept_at_standstill():
    store, slot = track_store()
    moving, standing = [[0.0, 0.6]], [[0.0, 0.4]]  # above and below 0.5 m/s
    first = states_of(0.0, [0], [[0, 0]], velocity=moving, yaw=[1.5 * math.pi])
    assert add(store, slot, first)[0, YAW] == pytest.approx(-0.5 * math.pi)
    second = states_of(0.1, [0], [[0, 0]], velocity=standing)
    assert add(store, slot, second)[0, YAW] == pytest.approx(-0.5 * math.pi)
    third = states_of(0.2, [0], [[0, 0]], velocity=moving, yaw=[1e7])  # not an angle
    assert add(store, slot, third)[0, YAW] == pytest.approx(0.5 * math.pi)


def test_interpolation_between_samples_and_extrapolation_of_the_last_one():
    left = np.array([[[0, 0, 2, 4, 0, 0, 3.0], [1, 1, 2, 4, 1, 1, -3.0], [5, 5, 2, 4, 0, 0, 0.5]]])
    right = np.array(
        [[[4, 8, 4, 4, 2, 0, -3.0], [1, 1, 2, 4, 1, 1, -3.0], [5, 5, 2, 4, 0, 0, 0.5]]]
    )
    brackets = Brackets(
        left=np.zeros((1, 3), dtype=np.intp),
        right=np.zeros((1, 3), dtype=np.intp),
        fraction=np.array([[0.25, 0.0, 0.0]]),
        after_s=np.array([0.5]),
        valid=np.array([[True, False, True]]),
    )
    sample = interpolate(left, right, brackets)
    assert sample[0, 0, :6].tolist() == [1, 2, 2.5, 4, 0.5, 0]
    # From 3.0 to -3.0 rad the short way: 0.2832 rad through pi, a quarter of it.
    assert sample[0, 0, 6] == pytest.approx(3.0 + 0.25 * (2 * math.pi - 6.0))
    assert np.isnan(sample[0, 1]).all()  # not valid
    assert sample[0, 2].tolist() == [5 + 0.5 * 2, 5 + 0.5 * 4, 2, 4, 0, 0, 0.5]


def test_unknown_velocities_are_filled_from_the_first_known_one():
    sample = np.zeros((1, 3, 7))
    sample[0, :2, 2:4] = NAN
    sample[0, 2, 2:4] = (3.0, 1.0)
    brackets = Brackets(
        left=np.zeros((1, 3), dtype=np.intp),
        right=np.zeros((1, 3), dtype=np.intp),
        fraction=np.zeros((1, 3)),
        after_s=np.zeros(1),
        valid=np.array([[False, True, True]]),
    )
    velocity = interpolate(sample, sample, brackets)[0, :, 2:4]
    assert np.isnan(velocity[0]).all()
    assert velocity[1:].tolist() == [[3.0, 1.0], [3.0, 1.0]]


def test_a_covariance_that_is_not_carried_on_keeps_what_is_known_of_it():
    covariance = np.full((2, 4, 4), np.nan)
    covariance[:, :2, :2] = np.eye(2)
    after = extrapolate_covariance(covariance, np.array([0.0, 0.2]))
    np.testing.assert_array_equal(after[0], covariance[0])
    assert np.isnan(after[1]).all()
    np.testing.assert_array_equal(covariance[1, :2, :2], np.eye(2))  # not changed in place


def test_covariances_grow_by_the_velocity():
    covariance = np.diag([1.0, 2.0, 0.5, 0.25])[None].repeat(2, axis=0)
    after = extrapolate_covariance(covariance, np.array([0.0, 2.0]))
    np.testing.assert_array_equal(after[0], covariance[0])
    expected = [
        [1.0 + 4.0 * 0.5, 0.0, 2.0 * 0.5, 0.0],
        [0.0, 2.0 + 4.0 * 0.25, 0.0, 2.0 * 0.25],
        [2.0 * 0.5, 0.0, 0.5, 0.0],
        [0.0, 2.0 * 0.25, 0.0, 0.25],
    ]
    np.testing.assert_allclose(after[1], expected)
