# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The pose of a vehicle from its odometry, through the bytes of the message."""

import math

import numpy as np
import pytest

from msg_adapters.conversions import make_pose, make_vector
from msg_adapters.inputs.odometry import ODOMETRY, pose_of, yaw_of


def odometry(types, yaw, forward=0.0, left=0.0, yaw_rate=0.0):
    twist = types.make(
        "geometry_msgs/msg/Twist",
        linear=make_vector(types, forward, left),
        angular=make_vector(types, 0.0, 0.0, yaw_rate),
    )
    pose = make_pose(types, np.array([3.0, -4.0]), 1.0, yaw)
    return types.make(
        ODOMETRY,
        pose=types.make("geometry_msgs/msg/PoseWithCovariance", pose=pose),
        twist=types.make("geometry_msgs/msg/TwistWithCovariance", twist=twist),
    )


def test_the_twist_of_the_child_frame_is_turned_into_the_headers(offline, decoded):
    """Heading along y: 10 m/s forwards are along y, 1 m/s to the left is along -x."""
    message = odometry(offline, math.pi / 2, forward=10.0, left=1.0, yaw_rate=0.25)
    for again in decoded(message, ODOMETRY, with_rclpy=True).values():
        pose = pose_of(again)
        assert (pose.x, pose.y, pose.yaw_rate) == (3.0, -4.0, 0.25)
        assert pose.yaw == pytest.approx(math.pi / 2)
        assert pose.velocity == pytest.approx((-1.0, 10.0))


@pytest.mark.parametrize("yaw", [0.0, 3.1, -3.1])
def test_the_yaw_of_a_quaternion(offline, yaw):
    pose = pose_of(odometry(offline, yaw))
    assert pose.yaw == pytest.approx(yaw)
    assert yaw_of(odometry(offline, yaw).pose.pose.orientation) == pose.yaw


def test_without_an_orientation_yaw_and_velocity_are_unknown(offline):
    pose = pose_of(odometry(offline, math.nan, forward=10.0))
    assert (pose.x, pose.y) == (3.0, -4.0)
    assert np.isnan([pose.yaw, *pose.velocity]).all()
