# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lifting of objects from a vehicle's frame into the fixed frame, by odometry or TF."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.time import Time

from msg_adapters.common import stamp_to_ns, yaw_from_quaternions
from mtpgo_core.errors import FrameError
from mtpgo_core.frames import Pose2, PoseBuffer, lift
from mtpgo_core.schema import TrackedStates

_ODOMETRY_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class Lifter(Protocol):
    """Brings observations into the fixed frame."""

    def lift(self, states: TrackedStates) -> TrackedStates:
        """The states in the fixed frame.

        Raises:
            FrameError: there is no pose for them.
        """

    def close(self) -> None:
        """Give the subscriptions back."""


class AsItComes:
    """No lifting: the objects' own frame is the fixed one."""

    def lift(self, states: TrackedStates) -> TrackedStates:
        """The states themselves."""
        return states

    def close(self) -> None:
        """Nothing to give back."""


class FixedFrameLifter:
    """Lifts with the odometry of the objects' frame, else with TF where that is installed.

    Args:
        node: the node, for the subscription.
        fixed_frame: name of the fixed frame.
    """

    def __init__(self, node: Node, fixed_frame: str) -> None:
        self._node = node
        self._fixed_frame = fixed_frame
        self._poses = PoseBuffer()
        self._odometry_frames = ("", "")
        self._subscription: Subscription = node.create_subscription(
            Odometry, "odometry", self.add, _ODOMETRY_QOS
        )
        self._tf = _tf_buffer(node)

    def add(self, message: Any) -> None:
        """Take in a nav_msgs/Odometry."""
        frames = (message.header.frame_id, message.child_frame_id)
        if frames != self._odometry_frames:
            self._poses.clear()
            self._odometry_frames = frames
        pose = message.pose.pose
        yaw = _yaw(pose.orientation)
        forward, left = message.twist.twist.linear.x, message.twist.twist.linear.y
        self._poses.add(
            stamp_to_ns(message.header.stamp),
            Pose2(
                x=pose.position.x,
                y=pose.position.y,
                yaw=yaw,
                velocity=(
                    math.cos(yaw) * forward - math.sin(yaw) * left,
                    math.sin(yaw) * forward + math.cos(yaw) * left,
                ),
                yaw_rate=message.twist.twist.angular.z,
            ),
        )

    def lift(self, states: TrackedStates) -> TrackedStates:
        """The states in the fixed frame.

        Raises:
            FrameError: neither odometry nor TF knows the pose at the observation's time.
        """
        if states.frame_id == self._fixed_frame:
            return states
        return lift(states, self._pose(states), self._fixed_frame)

    def _pose(self, states: TrackedStates) -> Pose2:
        if self._odometry_frames == (self._fixed_frame, states.frame_id):
            return self._poses.at(states.stamp_ns)
        if self._tf is not None:
            return self._pose_by_tf(states)
        parent, child = self._odometry_frames
        seen = f"it gives {child!r} in {parent!r}" if parent or child else "nothing came there"
        raise FrameError(
            f"objects come in frame {states.frame_id!r}, expected {self._fixed_frame!r}, or"
            f" odometry of {states.frame_id!r} in {self._fixed_frame!r} on topic"
            f" {self._subscription.topic_name}: {seen}"
        )

    def _pose_by_tf(self, states: TrackedStates) -> Pose2:
        time = Time(nanoseconds=states.stamp_ns, clock_type=self._node.get_clock().clock_type)
        try:
            found = self._tf.lookup_transform(self._fixed_frame, states.frame_id, time)
        except Exception as error:  # tf2's exceptions have no common base in Python.
            raise FrameError(
                f"TF has no transform from {states.frame_id!r} to {self._fixed_frame!r}: {error}"
            ) from error
        transform = found.transform
        return Pose2(
            x=transform.translation.x,
            y=transform.translation.y,
            yaw=_yaw(transform.rotation),
        )

    def close(self) -> None:
        """Give the subscriptions back."""
        self._node.destroy_subscription(self._subscription)
        self._tf = None


def _yaw(quaternion: Any) -> float:
    """Yaw (rad) of a geometry_msgs/Quaternion."""
    row = np.array([[quaternion.x, quaternion.y, quaternion.z, quaternion.w]])
    return float(yaw_from_quaternions(row)[0])


def _tf_buffer(node: Node) -> Any:
    """A filled TF buffer, None where tf2_ros is not installed (as with ROS from pip)."""
    try:
        from tf2_ros import Buffer, TransformListener
    except ImportError:
        return None
    buffer = Buffer(node=node)
    # The listener lives as long as the buffer refers to it.
    buffer.mtpgo_listener = TransformListener(buffer, node, spin_thread=False)
    return buffer
