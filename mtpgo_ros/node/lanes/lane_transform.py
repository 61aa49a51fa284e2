# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""TF from the frame of the observations to that of the lane lines."""

from __future__ import annotations

from rclpy.node import Node

from mtpgo_core.frames import Pose2
from mtpgo_ros.node.frame_transform import TfPoses
from mtpgo_ros.node.lanes.lane_input import PoseIn, no_pose

_NEWEST_NS = 0


class LaneTransform:
    """Listens to TF from the first time on that it is needed.

    Args:
        node: the node, for the subscriptions.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._tf: TfPoses | None = None

    def pose_in(self) -> PoseIn:
        """Return the function that asks TF, and begin to listen."""
        if self._tf is None:
            self._tf = TfPoses.if_installed(self._node)
        return no_pose if self._tf is None else self._pose

    def _pose(self, lane_frame: str, frame_id: str) -> Pose2:
        assert self._tf is not None
        return self._tf.pose(lane_frame, frame_id, _NEWEST_NS)

    def clear(self) -> None:
        """Forget the past: the clock was set back."""
        if self._tf is not None:
            self._tf.clear()

    def close(self) -> None:
        """Destroy the subscriptions."""
        if self._tf is not None:
            self._tf.close()
