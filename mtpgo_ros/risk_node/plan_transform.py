# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""TF from the frame of a plan to that of the predictions."""

from __future__ import annotations

from rclpy.node import Node

from mtpgo_core.frames import Pose2
from mtpgo_ros.node.frame_transform import TfPoses
from mtpgo_ros.risk_node.plan_frames import PoseAt, no_transform


class PlanTransform:
    """Listens to TF from the first time on that it is needed.

    Args:
        node: the node, for the subscriptions.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._tf: TfPoses | None = None
        self._pose_at: PoseAt = self._first_pose

    def pose(self, frame_id: str, plan_frame: str, stamp_ns: int) -> Pose2:
        """Return the pose of a plan's frame in another one at a time (ns).

        Raises:
            FrameError: TF has no transform at that time, or is not installed.
        """
        return self._pose_at(frame_id, plan_frame, stamp_ns)

    def _first_pose(self, frame_id: str, plan_frame: str, stamp_ns: int) -> Pose2:
        self._tf = TfPoses.if_installed(self._node)
        self._pose_at = no_transform if self._tf is None else self._tf.pose
        return self._pose_at(frame_id, plan_frame, stamp_ns)

    def clear(self) -> None:
        """Forget the past: the clock was set back."""
        if self._tf is not None:
            self._tf.clear()

    def close(self) -> None:
        """Destroy the subscriptions."""
        if self._tf is not None:
            self._tf.close()
