# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Pose of a vehicle from nav_msgs/Odometry, to transform its observations into a fixed frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from msg_adapters.conversions import stamp_to_ns, yaw_from_quaternions
from mtpgo_core.errors import MessageError
from mtpgo_core.frames import Pose2, is_place
from mtpgo_core.schema import FARTHEST_M

ODOMETRY = "nav_msgs/msg/Odometry"

LEAST_UPRIGHT = 0.5
"""Smallest vertical component of a frame's z axis; chosen: 60 degrees, more than any road or mount
of a lidar, less than the 90 degrees of a camera's optical frame."""


def pose_of(message: Any) -> Pose2:
    """Return pose and velocity of the message's child frame in its header's frame."""
    pose, twist = message.pose.pose, message.twist.twist
    yaw = yaw_of(pose.orientation)
    forward, left = twist.linear.x, twist.linear.y
    return Pose2(
        x=pose.position.x,
        y=pose.position.y,
        yaw=yaw,
        velocity=(
            math.cos(yaw) * forward - math.sin(yaw) * left,
            math.sin(yaw) * forward + math.cos(yaw) * left,
        ),
        yaw_rate=twist.angular.z,
    )


def dated_pose(message: Any, name: str) -> tuple[int, Pose2]:
    """Return the stamp (ns) of an odometry and its pose.

    Args:
        message: nav_msgs/Odometry.
        name: what the message is, for the error.

    Raises:
        MessageError: it has no stamp, no finite place or no orientation.
    """
    stamp_ns, pose = stamp_to_ns(message.header.stamp), pose_of(message)
    if stamp_ns <= 0:
        raise MessageError(f"{name} has no stamp, expected the pose's time")
    if not (math.isfinite(pose.yaw) and is_place(pose.x, pose.y)):
        raise MessageError(
            f"{name} has the pose ({pose.x:g}, {pose.y:g}) m, yaw {pose.yaw:g} rad, expected"
            f" numbers up to {FARTHEST_M:g} m and an orientation"
        )
    return stamp_ns, pose


def upright_part(quaternion: Any) -> float:
    """Return the vertical component of the z axis of a frame, -1 to 1.

    Args:
        quaternion: geometry_msgs/Quaternion, which need not be normalised; 1 for one of zeros.
    """
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    length = math.hypot(x, y, z, w) or 1.0
    return 1.0 - 2.0 * ((x / length) ** 2 + (y / length) ** 2)


def odometry_tilt(message: Any) -> str:
    """Return why the child frame of an odometry does not stand upright, empty if it does."""
    upright = upright_part(message.pose.pose.orientation)
    if not upright < LEAST_UPRIGHT:  # or without an orientation
        return ""
    return tilt_problem(str(message.child_frame_id), str(message.header.frame_id), upright)


def tilt_problem(frame_id: str, fixed_frame: str, upright: float) -> str:
    """Return why a frame that does not stand upright cannot be used.

    Args:
        frame_id: the frame.
        fixed_frame: the fixed frame.
        upright: vertical component of the frame's z axis, below :data:`LEAST_UPRIGHT`.
    """
    return (
        f"the z axis of frame {frame_id!r} is tilted by"
        f" {math.degrees(math.acos(max(-1.0, upright))):.0f} degrees in {fixed_frame!r},"
        " expected z up: an optical frame of a camera cannot be used, its body frame can"
    )


def pose_of_transform(message: Any) -> Pose2:
    """Return the pose of the child frame of a geometry_msgs/TransformStamped in its header's."""
    translation, rotation = message.transform.translation, message.transform.rotation
    return Pose2(x=translation.x, y=translation.y, yaw=yaw_of(rotation))


def yaw_of(quaternion: Any) -> float:
    """Return the yaw (rad) of a geometry_msgs/Quaternion."""
    row = np.array([[quaternion.x, quaternion.y, quaternion.z, quaternion.w]])
    return float(yaw_from_quaternions(row)[0])
