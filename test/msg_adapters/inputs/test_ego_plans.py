# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plans in messages, decoded from bytes: times, frames, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest

from msg_adapters.conversions import make_duration, make_header, make_pose, make_time, make_vector
from msg_adapters.inputs.ego_plans import PLANS
from mtpgo_core.errors import MessageError

START = 1_700_000_000_250_000_000
PATH, AUTOWARE, ODOMETRY = (PLANS[name] for name in ("path", "autoware", "odometry"))


def path(types, *, x=(0.0, 5.0, 10.0), step_s=1.0, frames=("map",) * 3, header="map", yaw=0.3):
    poses = [
        types.make(
            "geometry_msgs/msg/PoseStamped",
            header=make_header(types, START + round(1e9 * step_s * i), frame),
            pose=make_pose(types, np.array([place, 1.0]), 0.0, yaw),
        )
        for i, (place, frame) in enumerate(zip(x, frames, strict=False))
    ]
    return types.make("nav_msgs/msg/Path", header=make_header(types, START, header), poses=poses)


def trajectory(types, *, x=(0.0, 5.0, 10.0), times_s=(0.0, 1.0, 2.0), speed=(0.0, 0.0, 0.0)):
    points = [
        types.make(
            "autoware_planning_msgs/msg/TrajectoryPoint",
            time_from_start=make_duration(types, time_s),
            pose=make_pose(types, np.array([place, 1.0]), 0.0, 0.3),
            longitudinal_velocity_mps=mps,
            front_wheel_angle_rad=0.01,
        )
        for place, time_s, mps in zip(x, times_s, speed, strict=True)
    ]
    return types.make(
        "autoware_planning_msgs/msg/Trajectory",
        header=make_header(types, START, "map"),
        points=points,
    )


def odometry(types, speed=3.0):
    return types.make(
        "nav_msgs/msg/Odometry",
        header=make_header(types, START, "odom"),
        child_frame_id="base_link",
        pose=types.make(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=make_pose(types, np.array([1.0, 2.0]), 0.0, 0.5 * math.pi),
        ),
        twist=types.make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=types.make("geometry_msgs/msg/Twist", linear=make_vector(types, speed, 0.0)),
        ),
    )


@pytest.mark.parametrize(("adapter", "make"), [(PATH, path), (AUTOWARE, trajectory)])
def test_a_plan_is_decoded_from_bytes_by_every_decoder(adapter, make, offline, decoded):
    with_rclpy = adapter is PATH  # rclpy needs autoware's package for the other one
    for message in decoded(make(offline), adapter.message_type, with_rclpy=with_rclpy).values():
        plan = adapter.plan(message)
        assert (plan.stamp_ns, plan.frame_id, plan.stands_after) == (START, "map", False)
        assert (plan.time_ns - START).tolist() == [0, 1_000_000_000, 2_000_000_000]
        np.testing.assert_allclose(plan.position, [[0.0, 1.0], [5.0, 1.0], [10.0, 1.0]])
        np.testing.assert_allclose(plan.yaw, 0.3)
        assert adapter.plan(message, stands_after=True).stands_after


def test_odometry_is_constant_velocity_along_its_heading(offline, decoded):
    for message in decoded(odometry(offline), ODOMETRY.message_type, with_rclpy=True).values():
        plan = ODOMETRY.plan(message)
        assert (plan.stamp_ns, plan.frame_id) == (START, "odom")
        position, yaw = plan.at(START, np.array([2.0]))
        np.testing.assert_allclose(position, [[1.0, 8.0]], atol=1e-9)
        np.testing.assert_allclose(yaw, 0.5 * math.pi)


def test_a_path_whose_poses_have_no_stamps_has_no_times(offline):
    with pytest.raises(MessageError, match="path has no times: its 3 poses all have the time"):
        PATH.plan(path(offline, step_s=0.0))
    message = path(offline)
    for pose in message.poses:
        pose.header.stamp = make_time(offline, 0)
    with pytest.raises(MessageError, match="path has no times"):
        PATH.plan(message)


def test_the_frame_may_be_in_header_or_poses_but_must_be_one(offline):
    assert PATH.plan(path(offline, frames=("",) * 3)).frame_id == "map"
    assert PATH.plan(path(offline, header="")).frame_id == "map"
    with pytest.raises(MessageError, match="'odom'"):
        PATH.plan(path(offline, frames=("map", "odom", "map")))
    with pytest.raises(MessageError, match="names no frame"):
        PATH.plan(path(offline, header="", frames=("",) * 3))


@pytest.mark.parametrize("x", [(), (1.0,)])
def test_an_empty_path_is_refused(offline, x):
    with pytest.raises(MessageError, match=f"path has {len(x)} poses, expected at least 2"):
        PATH.plan(path(offline, x=x))


def test_numbers_that_are_not_finite_are_refused(offline):
    with pytest.raises(MessageError, match="at pose 1, expected finite numbers"):
        PATH.plan(path(offline, x=(0.0, math.nan, 2.0)))
    with pytest.raises(MessageError, match="expected finite numbers"):
        ODOMETRY.plan(odometry(offline, speed=math.inf))


def test_odometry_of_an_optical_frame_is_no_plan(offline):
    """Its z axis points ahead: the velocity along x would be one to the right."""
    message = odometry(offline)
    pose = message.pose.pose
    optical = dataclasses.replace(pose.orientation, x=-0.5, y=0.5, z=-0.5, w=0.5)
    tilted = dataclasses.replace(message.pose, pose=dataclasses.replace(pose, orientation=optical))
    with pytest.raises(MessageError, match="odometry: the z axis of frame 'base_link' is tilted"):
        ODOMETRY.plan(dataclasses.replace(message, pose=tilted))


def test_a_trajectory_without_times_is_driven_at_its_velocities(offline):
    message = trajectory(offline, times_s=(0.0, 0.0, 0.0), speed=(4.0, 6.0, 4.0))
    plan = AUTOWARE.plan(message)
    np.testing.assert_allclose((plan.time_ns - START) * 1e-9, [0.0, 1.0, 2.0])
    assert not plan.stands_after


def test_a_trajectory_without_times_ends_where_the_vehicle_stops(offline):
    message = trajectory(offline, times_s=(0.0, 0.0, 0.0), speed=(10.0, 0.0, 0.0))
    plan = AUTOWARE.plan(message)
    np.testing.assert_allclose((plan.time_ns - START) * 1e-9, [0.0, 1.0])
    np.testing.assert_allclose(plan.position[-1], [5.0, 1.0])
    assert plan.stands_after
    standing = trajectory(offline, times_s=(0.0, 0.0, 0.0), speed=(0.0, 0.0, 0.0))
    plan = AUTOWARE.plan(standing)
    np.testing.assert_allclose(plan.at(START, np.array([9.0]))[0], [[0.0, 1.0]])
    with pytest.raises(MessageError, match="neither times nor finite velocities"):
        AUTOWARE.plan(trajectory(offline, times_s=(0.0,) * 3, speed=(1.0, math.nan, 1.0)))


def test_a_trajectory_that_takes_for_ever_is_refused(offline):
    far = trajectory(offline, x=(0.0, 4e7, 8e7), times_s=(0.0,) * 3, speed=(1.0,) * 3)
    with pytest.raises(MessageError, match=r"trajectory takes 8e\+07 s at its velocities"):
        AUTOWARE.plan(far)
    lost = trajectory(offline, x=(0.0, math.nan, 8.0), times_s=(0.0,) * 3, speed=(1.0,) * 3)
    with pytest.raises(MessageError, match=r"trajectory has the position .* at pose 1"):
        AUTOWARE.plan(lost)


def test_bytes_are_checked_before_they_are_decoded(offline, typestore):
    for adapter, message in ((PATH, path(offline)), (AUTOWARE, trajectory(offline))):
        data = bytearray(typestore.serialize_cdr(message, adapter.message_type))
        adapter.check_serialized(bytes(data))
        count = 4 + 8 + 4 + 4  # encoding, stamp, length of the frame's name, "map"
        for claimed, words in ((20_000, "20000 poses, expected at most 10000"), (9, "claims 9")):
            data[count : count + 4] = claimed.to_bytes(4, "little")
            with pytest.raises(MessageError, match=words):
                adapter.check_serialized(bytes(data))
        with pytest.raises(MessageError, match="is cut off"):
            adapter.check_serialized(bytes(data[:18]))
    ODOMETRY.check_serialized(b"")  # it has no list


def test_another_message_is_refused(offline):
    with pytest.raises(MessageError, match="cannot be read as nav_msgs/msg/Path"):
        PATH.plan(odometry(offline))
