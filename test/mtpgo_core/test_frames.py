# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Frames: there and back, by hand-worked numbers, and against sampled distributions."""

import math

import numpy as np
import pytest
import torch
from core_helpers import S_NS, states_of

from models.own_frame.agent_frames import heading
from mtpgo_core.errors import FrameError
from mtpgo_core.frames import (
    Pose2,
    PoseBuffer,
    along_and_across,
    own_heading,
    rotate,
    rotate_covariance,
    to_fixed_frame,
    wrap,
)

QUARTER = math.pi / 2


def test_a_quarter_turn_takes_x_to_y():
    np.testing.assert_allclose(rotate(np.array([1.0, 0.0]), QUARTER), [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(rotate(np.array([0.0, 2.0]), QUARTER), [-2.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("size", [2, 4])
def test_covariance_turns_like_the_vectors_that_it_describes(size):
    draw = np.random.default_rng(0)
    factor = draw.normal(size=(5, size, size))
    covariance = factor @ factor.transpose(0, 2, 1)
    angle = draw.uniform(-4, 4, 5)
    turned = rotate_covariance(covariance, angle)
    direction = draw.normal(size=(5, size // 2, 2))
    # var(u' R v) = u' R C R' u for any direction u of the turned frame.
    back = rotate(direction, -angle[:, None]).reshape(5, size)
    flat = direction.reshape(5, size)
    np.testing.assert_allclose(
        np.einsum("ni,nij,nj->n", flat, turned, flat),
        np.einsum("ni,nij,nj->n", back, covariance, back),
    )
    np.testing.assert_allclose(rotate_covariance(turned, -angle), covariance, atol=1e-12)


def test_a_position_keeps_its_covariance_where_that_of_the_velocity_is_not_known():
    """As from a Detection3DArray, which has no velocities."""
    covariance = np.full((2, 4, 4), np.nan)
    covariance[:, :2, :2] = np.diag([4.0, 1.0])
    turned = rotate_covariance(covariance, np.array([QUARTER, 0.0]))
    np.testing.assert_allclose(turned[0, :2, :2], np.diag([1.0, 4.0]), atol=1e-15)
    np.testing.assert_allclose(turned[1, :2, :2], np.diag([4.0, 1.0]), atol=1e-15)
    assert np.isnan(turned[:, 2:]).all()
    assert np.isnan(turned[:, :, 2:]).all()


def test_variances_along_and_across_are_entries_of_the_turned_covariance():
    draw = np.random.default_rng(4)
    factor = draw.normal(size=(3, 5, 2, 2))
    covariance = factor @ np.swapaxes(factor, -1, -2)
    angle = draw.uniform(-4, 4, (3, 5))
    turned = rotate_covariance(covariance, -angle)
    along, both, across = along_and_across(covariance, angle)
    np.testing.assert_allclose(along, turned[..., 0, 0])
    np.testing.assert_allclose(both, turned[..., 0, 1], atol=1e-14)
    np.testing.assert_allclose(across, turned[..., 1, 1])


def test_points_there_and_back():
    draw = np.random.default_rng(1)
    points = draw.uniform(-50, 50, (20, 2))
    pose = Pose2(412_000.0, 5_400_000.0, 2.3)
    np.testing.assert_allclose(pose.inverse_point(pose.point(points)), points, atol=1e-8)


def vehicle_states():
    return states_of(
        1.0,
        [1],
        [[10.0, 2.0]],
        frame="base_link",
        velocity=[[3.0, 0.0]],
        acceleration=[[1.0, 0.0]],
        yaw=[QUARTER + 2.0],
        covariance=np.diag([4.0, 1.0, 0.5, 0.25])[None],
    )


def test_lift_by_hand():
    lifted = to_fixed_frame(vehicle_states(), Pose2(100.0, 200.0, QUARTER), "map")
    assert lifted.frame_id == "map"
    np.testing.assert_allclose(lifted.position, [[98.0, 210.0]], atol=1e-12)
    np.testing.assert_allclose(lifted.velocity, [[0.0, 3.0]], atol=1e-12)
    np.testing.assert_allclose(lifted.acceleration, [[0.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(lifted.yaw, [2.0 - math.pi], atol=1e-12)
    np.testing.assert_allclose(lifted.covariance[0], np.diag([1.0, 4.0, 0.25, 0.5]), atol=1e-12)


def test_relative_velocity_gains_the_vehicles_own_motion():
    # At rest on the ground, ten metres ahead and two to the left of a turning vehicle.
    pose = Pose2(0.0, 0.0, 0.0, velocity=(8.0, 0.0), yaw_rate=0.5)
    states = vehicle_states()
    states.velocity[0] = (-8.0 + 0.5 * 2.0, -0.5 * 10.0)
    lifted = to_fixed_frame(states, pose, "odom", relative_velocity=True)
    np.testing.assert_allclose(lifted.velocity, [[0.0, 0.0]], atol=1e-12)


def test_unknown_stays_unknown_when_lifted():
    lifted = to_fixed_frame(
        states_of(0.0, [1], [[1.0, 1.0]], frame="base_link"), Pose2(0, 0, 1.0), "map"
    )
    assert np.isnan(lifted.velocity).all()
    assert np.isnan(lifted.yaw).all()
    assert np.isnan(lifted.covariance).all()


def test_a_pose_that_is_not_finite_is_an_error():
    with pytest.raises(FrameError, match="expected finite numbers"):
        to_fixed_frame(vehicle_states(), Pose2(0.0, math.nan, 0.0), "map")


def test_a_pose_that_is_no_place_is_not_taken():
    poses = PoseBuffer()
    assert not poses.add(S_NS, Pose2(1e9, 0.0, 0.0))
    assert not poses.add(S_NS, Pose2(0.0, -1e300, 0.0))
    assert not poses.add(S_NS, Pose2(math.nan, 0.0, 0.0))
    assert poses.add(S_NS, Pose2(6e5, 5e6, 0.0))  # UTM


def test_an_unknown_motion_matters_only_where_it_is_needed():
    poses = PoseBuffer()
    poses.add(S_NS, Pose2(1.0, 2.0, 0.0, velocity=(math.nan, 0.0), yaw_rate=math.nan))
    pose = poses.at(S_NS + 100_000_000)
    assert (pose.x, pose.y) == (1.0, 2.0)
    lifted = to_fixed_frame(vehicle_states(), pose, "map")
    np.testing.assert_allclose(lifted.position, vehicle_states().position + np.array((1.0, 2.0)))
    with pytest.raises(FrameError, match="expected finite numbers"):
        to_fixed_frame(vehicle_states(), pose, "map", relative_velocity=True)


def test_poses_are_interpolated_along_the_shorter_arc():
    poses = PoseBuffer()
    assert poses.add(0, Pose2(0.0, 0.0, 3.0, (1.0, 0.0), 0.2))
    assert poses.add(S_NS, Pose2(4.0, -2.0, -3.0, (3.0, 2.0), 0.4))
    pose = poses.at(S_NS // 2)
    assert (pose.x, pose.y) == (2.0, -1.0)
    assert abs(pose.yaw) == pytest.approx(math.pi)
    assert pose.velocity == (2.0, 1.0)
    assert pose.yaw_rate == pytest.approx(0.3)


def test_just_beyond_the_ends_the_motion_goes_on_and_farther_is_an_error():
    poses = PoseBuffer(max_extrapolation_s=0.2)
    with pytest.raises(FrameError, match="no pose is known"):
        poses.at(0)
    poses.add(S_NS, Pose2(1.0, 1.0, 0.0, (10.0, 0.0), 1.0))
    pose = poses.at(S_NS + 100_000_000)
    assert (pose.x, pose.yaw) == (pytest.approx(2.0), pytest.approx(0.1))
    assert poses.at(S_NS - 100_000_000).x == pytest.approx(0.0)
    for far in (S_NS + 300_000_000, S_NS - 300_000_000):
        with pytest.raises(FrameError, match=r"0\.300 s away, expected at most 0\.200 s"):
            poses.at(far)


@pytest.mark.parametrize("twist", [0.0, math.nan])
def test_without_a_twist_the_motion_is_that_of_the_poses(twist):
    """At 20 m/s odometry that is 0.1 s old would be 2 m behind."""
    poses = PoseBuffer()
    for k in (0, 1, 2, 3, 3.01):  # the last two are too close to tell a motion
        time_ns = round(k * S_NS / 10)
        assert poses.add(time_ns, Pose2(2.0 * k, -k, 3.1 + 0.02 * k, (twist, twist), twist))
    for time_s in (0.4, -0.1):
        pose = poses.at(round(time_s * S_NS))
        assert (pose.x, pose.y) == (pytest.approx(20.0 * time_s), pytest.approx(-10.0 * time_s))
        assert pose.yaw == pytest.approx(float(wrap(np.asarray(3.1 + 0.2 * time_s))))


def test_a_twist_of_zeros_counts_once_there_was_another():
    """A vehicle that stands is not moved by a correction of its place."""
    poses = PoseBuffer()
    for k, speed in enumerate((1.0, 0.0, 0.0)):
        poses.add(k * S_NS // 10, Pose2(0.5 * k, 0.0, 0.0, (speed, 0.0)))
    assert poses.at(3 * S_NS // 10).x == 1.0
    slow = PoseBuffer()
    for k in range(2):  # a second apart, which tells nothing of the next moment
        slow.add(k * S_NS, Pose2(5.0 * k, 0.0, 0.0))
    later = slow.at(S_NS + 100_000_000)
    assert (later.x, later.y, later.yaw) == (5.0, 0.0, 0.0)


def test_a_frame_rests_unless_its_motion_is_given():
    rest = to_fixed_frame(vehicle_states(), Pose2(0.0, 0.0, 0.0), "map", relative_velocity=True)
    np.testing.assert_allclose(rest.velocity, vehicle_states().velocity, atol=1e-12)


def test_poses_may_come_in_any_order_and_are_forgotten():
    poses = PoseBuffer(span_s=2.0)
    for k in (0, 3, 1, 2, 10, 9):
        assert poses.add(k * S_NS // 10, Pose2(k, 0.0, 0.0))
    assert not poses.add(0, Pose2(99.0, 0.0, 0.0))  # the stamp is there already
    assert not poses.add(5, Pose2(math.inf, 0.0, 0.0))
    assert [poses.at(k * S_NS // 20).x for k in range(7)] == [0, 0.5, 1, 1.5, 2, 2.5, 3]
    poses.add(25 * S_NS // 10, Pose2(25, 0.0, 0.0))
    assert len(poses) == 3
    poses.add(0, Pose2(-1.0, 0.0, 0.0))  # the clock was set back
    assert len(poses) == 1
    assert poses.at(0).x == -1.0


def test_poses_of_a_clock_that_was_set_back_are_not_mixed_with_new_ones():
    poses = PoseBuffer(set_back_s=0.5)
    for step in range(10):
        poses.add(1_000_000_000 + 100_000_000 * step, Pose2(100.0, 0.0, 0.0))
    poses.add(1_450_000_000, Pose2(99.0, 0.0, 0.0))  # only late
    assert poses.at(1_900_000_000).x == 100.0
    # The same stamps again, at another place: as after the reset of a simulation.
    for step in range(3):
        assert poses.add(1_000_000_000 + 100_000_000 * step, Pose2(0.0, 0.0, 0.0))
    assert poses.at(1_050_000_000).x == poses.at(1_250_000_000).x == 0.0
    with pytest.raises(FrameError):
        poses.at(1_900_000_000)


def test_the_own_heading_is_that_of_the_network():
    rng = np.random.default_rng(0)
    speed = np.concatenate([np.linspace(0.0, 1.5, 200), rng.uniform(0.0, 40.0, 200)])
    course, yaw = rng.uniform(-4.0, 4.0, (2, 400))
    velocity = speed[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
    angle = own_heading(velocity, yaw)
    expected = heading(
        torch.from_numpy(velocity), torch.from_numpy(np.stack([np.cos(yaw), np.sin(yaw)], axis=1))
    ).numpy()
    known = np.isfinite(angle)  # two opposite directions may cancel
    assert known.sum() > 390
    found = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(found[known], expected[known], atol=1e-9)


def test_the_own_heading_is_unknown_where_neither_velocity_nor_yaw_gives_one():
    velocity = np.array([[0.7, 0.0], [1.2, 0.0], [0.0, 0.0], [np.nan, np.nan], [np.nan, np.nan]])
    yaw = np.array([np.nan, np.nan, 0.3, 0.3, np.nan])
    np.testing.assert_allclose(own_heading(velocity, yaw), [np.nan, 0.0, 0.3, 0.3, np.nan])
