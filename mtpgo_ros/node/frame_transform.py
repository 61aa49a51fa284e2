# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transform of objects from a vehicle's frame into the fixed frame, by odometry or TF."""

from __future__ import annotations

import dataclasses
import threading
from typing import Any, Protocol

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.time import Time

from msg_adapters.inputs.odometry import (
    LEAST_UPRIGHT,
    dated_pose,
    odometry_tilt,
    pose_of_transform,
    tilt_problem,
    upright_part,
)
from mtpgo_core.errors import FrameError, MessageError
from mtpgo_core.frames import Pose2, PoseBuffer, to_fixed_frame
from mtpgo_core.history.stream_guard import LATE_NS
from mtpgo_core.schema import TrackedStates
from mtpgo_ros.diagnostics.event_log import EventLog

_ODOMETRY_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Queue of odometry: half a second at 100 Hz."""


_MOST_FRAMES = 8
"""Pairs of frames of which poses are kept; chosen above what one topic has."""


class FrameTransform(Protocol):
    """Transforms observations into the fixed frame."""

    def apply(self, states: TrackedStates) -> TrackedStates:
        """Return the states in the fixed frame.

        Raises:
            FrameError: there is no pose at their time.
        """

    def clear(self) -> None:
        """Forget the past: the clock was set back."""

    def close(self) -> None:
        """Destroy the subscriptions."""


class NoTransform:
    """No transform: the objects' own frame is the fixed one."""

    def apply(self, states: TrackedStates) -> TrackedStates:
        """Return the states unchanged."""
        return states

    def clear(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing: there are no subscriptions."""


class FixedFrameTransform:
    """Transforms with the odometry of the objects' frame, else with TF if that is installed.

    Args:
        node: the node, for the subscription.
        fixed_frame: name of the fixed frame.
        events: where unusable odometry is counted.
    """

    def __init__(self, node: Node, fixed_frame: str, events: EventLog) -> None:
        self._node, self._events = node, events
        self._fixed_frame = fixed_frame
        # By the names of parent and child: two publishers may share the topic.
        self._poses: dict[tuple[str, str], PoseBuffer] = {}
        self._tilted: dict[tuple[str, str], str] = {}  # why that child cannot be used
        # Objects are transformed on the thread of their subscription.
        self._lock = threading.Lock()
        self._odometry_frames = ("", "")
        self._subscription: Subscription = node.create_subscription(
            Odometry, "odometry", self.add_odometry, _ODOMETRY_QOS
        )
        self._tf = TfPoses.if_installed(node)

    def add_odometry(self, message: Any) -> None:
        """Add the pose of a nav_msgs/Odometry; one that is none is left out and counted."""
        frames = (message.header.frame_id, message.child_frame_id)
        try:
            stamp_ns, pose = dated_pose(message, "odometry")
        except MessageError as error:
            topic = self._subscription.topic_name
            line = f"message on {topic} left out: {error}"
            self._events.count("odometry_refused", reason=line, detail=str(error))
            return
        with self._lock:
            self._odometry_frames = frames
            poses = self._poses.pop(frames, None) or PoseBuffer(set_back_s=1e-9 * LATE_NS)
            poses.add(stamp_ns, pose)
            self._poses[frames] = poses  # as the newest
            self._tilted[frames] = odometry_tilt(message)
            if len(self._poses) > _MOST_FRAMES:
                oldest = next(iter(self._poses))
                del self._poses[oldest], self._tilted[oldest]

    def apply(self, states: TrackedStates) -> TrackedStates:
        """Return the states in the fixed frame.

        Raises:
            FrameError: neither odometry nor TF has the pose at the observation's time, or the
                frame does not stand upright.
        """
        if states.frame_id == self._fixed_frame:
            return states
        if len(states) == 0:  # Some empty messages name no frame.
            return dataclasses.replace(states, frame_id=self._fixed_frame)
        return to_fixed_frame(states, self._pose(states), self._fixed_frame)

    def _pose(self, states: TrackedStates) -> Pose2:
        frames = (self._fixed_frame, states.frame_id)
        reason = ""
        with self._lock:
            poses = self._poses.get(frames)
            if poses is not None:
                if self._tilted[frames]:
                    raise FrameError(self._tilted[frames])
                try:
                    return poses.at(states.stamp_ns)
                except FrameError as error:  # as of odometry that is slow, or has ended
                    if self._tf is None:
                        raise
                    reason = f"{error}; "
        if self._tf is not None:
            try:
                return self._tf.pose(*frames, states.stamp_ns)
            except FrameError as error:
                raise FrameError(f"{reason}{error}") from error
        parent, child = self._odometry_frames
        seen = f"it gives {child!r} in {parent!r}" if parent or child else "nothing came there"
        raise FrameError(
            f"objects come in frame {states.frame_id!r}, expected {self._fixed_frame!r}, or"
            f" odometry of {states.frame_id!r} in {self._fixed_frame!r} on topic"
            f" {self._subscription.topic_name}: {seen}"
        )

    def clear(self) -> None:
        """Forget the past: the clock was set back."""
        with self._lock:
            for poses in self._poses.values():
                poses.clear()
        if self._tf is not None:
            self._tf.clear()

    def close(self) -> None:
        """Destroy the subscriptions."""
        self._node.destroy_subscription(self._subscription)
        if self._tf is not None:
            self._tf.close()


class TfPoses:
    """Poses from TF.

    Args:
        node: the node, for clock and subscriptions.
        tf2_ros: the module tf2_ros.
    """

    def __init__(self, node: Node, tf2_ros: Any) -> None:
        self._clock_type = node.get_clock().clock_type
        # Given the node, it would have a service, which stays after its end.
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, node, spin_thread=False)

    @classmethod
    def if_installed(cls, node: Node) -> TfPoses | None:
        """Return None if tf2_ros is not installed, as with ROS from pip."""
        try:
            import tf2_ros
        except ImportError:
            return None
        return cls(node, tf2_ros)

    def pose(self, fixed_frame: str, frame_id: str, stamp_ns: int) -> Pose2:
        """Return the pose of ``frame_id`` in ``fixed_frame`` at a time (ns), 0 for the newest.

        Raises:
            FrameError: TF has no transform at that time, or the frame does not stand upright.
        """
        time = Time(nanoseconds=stamp_ns, clock_type=self._clock_type)
        try:
            found = self._buffer.lookup_transform(fixed_frame, frame_id, time)
        except Exception as error:  # tf2's exceptions have no common base in Python.
            raise FrameError(
                f"TF has no transform from {frame_id!r} to {fixed_frame!r}: {error}"
            ) from error
        upright = upright_part(found.transform.rotation)
        if upright < LEAST_UPRIGHT:
            raise FrameError(tilt_problem(frame_id, fixed_frame, upright))
        return pose_of_transform(found)

    def clear(self) -> None:
        """Forget all transforms but the static ones: the clock was set back.

        TF drops what is older than its newest transform by ten seconds, and would mix the rest.
        """
        self._buffer.clear()

    def close(self) -> None:
        """Destroy the subscriptions."""
        self._listener.unregister()
