# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Times, yaw, object frames, covariances and identities, worked by hand."""

import numpy as np
import pytest

from msg_adapters.conversions import (
    choose_twist_frame,
    finite,
    flat36,
    known,
    make_duration,
    make_quaternion,
    make_time,
    most_probable,
    planar_block,
    pose_row,
    positive,
    small_integer_keys,
    stamp_to_ns,
    state_covariance,
    table,
    to_header_frame,
    yaw_from_quaternions,
)
from mtpgo_core.errors import ConfigurationError, MessageError
from mtpgo_core.identity import keys_from_integers

NAN = float("nan")


def test_the_users_twist_frame_overrides_that_of_the_message():
    assert choose_twist_frame("default", "object") == "object"
    assert choose_twist_frame("header", "object") == "header"
    with pytest.raises(ConfigurationError, match="twist_frame is 'map', expected one of"):
        choose_twist_frame("map", "object")


@pytest.mark.parametrize("stamp_ns", [0, 1, 999_999_999, 1_700_000_000_123_456_789, -1])
def test_a_stamp_survives_the_round_trip(offline, stamp_ns):
    stamp = make_time(offline, stamp_ns)
    assert 0 <= stamp.nanosec < 1_000_000_000
    assert stamp_to_ns(stamp) == stamp_ns


def test_a_fraction_of_more_than_a_second_counts_and_the_last_stamp_is_the_last(offline):
    def stamp(sec, nanosec):
        return offline.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    assert stamp_to_ns(stamp(5, 1_500_000_000)) == 6_500_000_000
    last = stamp(2**31 - 1, 999_999_999)
    assert make_time(offline, stamp_to_ns(last)) == last
    with pytest.raises(MessageError, match="stamp is 2147483647 s and 1000000000 ns, expected"):
        stamp_to_ns(stamp(2**31 - 1, 1_000_000_000))


def test_a_duration_is_rounded_to_nanoseconds(offline):
    durations = [make_duration(offline, seconds) for seconds in (0.2, 1.9999999999, 25.0)]
    assert [(d.sec, d.nanosec) for d in durations] == [(0, 200_000_000), (2, 0), (25, 0)]


def test_yaw_by_hand():
    """Identity, a quarter turn, that turn not normalised, with roll, and one that is not set."""
    half = np.sqrt(0.5)
    quaternions = np.array(
        [
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, half, half],
            [0.0, 0.0, 7.0, 7.0],
            [half, 0.0, 0.0, half],
            [0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, np.inf, 1.0],
        ]
    )
    expected = [0.0, np.pi / 2, np.pi / 2, 0.0, NAN, NAN]
    np.testing.assert_allclose(yaw_from_quaternions(quaternions), expected, atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 3.0, -3.0, NAN])
def test_yaw_survives_the_round_trip(offline, yaw):
    q = make_quaternion(offline, yaw)
    assert yaw_from_quaternions(np.array([[q.x, q.y, q.z, q.w]])) == pytest.approx(
        [yaw], nan_ok=True
    )


def test_unknown_numbers_are_nan_in_arrays_and_zero_in_messages():
    np.testing.assert_array_equal(finite([1.0, np.inf, -np.inf, NAN]), [1.0, NAN, NAN, NAN])
    np.testing.assert_array_equal(positive([2.0, 0.0, -1.0, np.inf]), [2.0, NAN, NAN, NAN])
    assert [known(2.5), known(NAN), known(np.inf, 7.0)] == [2.5, 0.0, 7.0]
    assert table([], 3).shape == (0, 3)


def test_vectors_of_the_object_frame_turn_with_the_object():
    vector, yaw = np.array([[3.0, 4.0], [3.0, 4.0]]), np.array([np.pi / 2, NAN])
    np.testing.assert_allclose(
        to_header_frame(vector, yaw, "object"), [[-4.0, 3.0], [NAN, NAN]], atol=1e-12
    )
    np.testing.assert_array_equal(to_header_frame(vector, yaw, "header"), vector)


def test_a_velocity_covariance_turns_with_the_object():
    """Forwards 4, sideways 1 (m^2/s^2) at a quarter turn: x and y are exchanged."""
    position, velocity = np.diag([0.5, 0.25])[None], np.array([[[4.0, 0.5], [0.5, 1.0]]])
    yaw = np.array([np.pi / 2])
    (turned,) = state_covariance(position, velocity, yaw, "object")
    expected = np.zeros((4, 4))
    expected[:2, :2], expected[2:, 2:] = position[0], [[1.0, -0.5], [-0.5, 4.0]]
    np.testing.assert_allclose(turned, expected, atol=1e-12)
    (kept,) = state_covariance(position, velocity, yaw, "header")
    np.testing.assert_array_equal(kept[2:, 2:], velocity[0])


def test_a_block_without_two_positive_variances_is_unknown():
    filled, unset, half = np.eye(2), np.zeros((2, 2)), np.diag([1.0, 0.0])
    position, velocity = np.stack([filled, filled, unset]), np.stack([unset, half, filled])
    covariance = state_covariance(position, velocity, np.zeros(3), "header")
    known_entries = np.isfinite(covariance)
    expected = np.zeros((3, 4, 4), dtype=bool)
    expected[:2, :2, :2] = True
    expected[2, 2:, 2:] = True
    np.testing.assert_array_equal(known_entries, expected)


def test_the_planar_block_survives_the_round_trip():
    block = np.array([[1.0, 2.0], [3.0, 4.0]])
    flat = flat36(block)
    assert (flat.shape, np.count_nonzero(flat)) == ((36,), 4)
    assert planar_block(flat) == (1.0, 2.0, 3.0, 4.0)
    assert not flat36(np.array([[1.0, NAN], [NAN, 1.0]])).any()


def test_an_identity_must_fit_the_integer_of_the_message():
    assert small_integer_keys(keys_from_integers([0, 2**32 - 1]), 32, "a/B") == [0, 2**32 - 1]
    with pytest.raises(MessageError, match="0x100000000 does not fit into the 32-bit id of a/B"):
        small_integer_keys(keys_from_integers([1, 2**32]), 32, "a/B")


def test_a_pose_is_read_position_first(offline):
    pose = offline.make(
        "geometry_msgs/msg/Pose",
        position=offline.make("geometry_msgs/msg/Point", x=1.0, y=2.0, z=3.0),
        orientation=offline.make("geometry_msgs/msg/Quaternion", x=4.0, y=5.0, z=6.0, w=7.0),
    )
    assert pose_row(pose) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)


def test_a_quaternion_of_any_length_and_one_without_a_yaw():
    """Squares of these are no numbers; the last ones point the x axis up, without a yaw."""
    half = np.sqrt(0.5)
    quaternions = np.array(
        [
            [0.0, 0.0, 1e-200, 1e-200],
            [0.0, 0.0, 1e200, 1e200],
            [0.0, half, 0.0, half],
            [0.0, -half, 0.0, half],
            [-0.3, half, 0.3, half],
        ]
    )
    expected = [np.pi / 2, np.pi / 2, NAN, NAN, NAN]
    np.testing.assert_allclose(yaw_from_quaternions(quaternions), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "best"),
    [
        ([0.2, 0.7, 0.1], 1),
        ([0.5, 0.5], 0),
        ([NAN, 0.1], 1),
        ([0.1, NAN], 0),
        ([np.inf, 0.3], 1),
        ([NAN, NAN], 0),
        ([-3.0, -1.0], 1),
    ],
)
def test_the_most_probable_of_several(given, best):
    assert most_probable(list(enumerate(given)), lambda item: item[1])[0] == best
    assert most_probable([], float) is None
