# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transforms objects from the vehicle's frame with the odometry of the same bag.

The node does the same with ``fixed_frame`` and the topic ``odometry``, so a bag of its inputs can
be read unchanged.
"""

from __future__ import annotations

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.conversions import stamp_to_ns
from msg_adapters.inputs.odometry import ODOMETRY, pose_of
from mtpgo_core.errors import FrameError
from mtpgo_core.frames import PoseBuffer, to_fixed_frame
from mtpgo_core.schema import TrackedStates

_WHOLE_BAG_S = 1e9
"""Time over which poses are kept (s): longer than any bag."""


class BagPoses:
    """The poses in all odometry of a bag.

    Args:
        reader: the bag.

    Attributes:
        problem: why the last observation could not be transformed, empty if all could.
    """

    def __init__(self, reader: DecodingBagReader) -> None:
        self.problem = ""
        self._poses: dict[str, tuple[str, PoseBuffer]] = {}
        topics = sorted(c.topic for c in reader.connections if c.msgtype == ODOMETRY)
        for topic in topics:
            mine = [c for c in reader.connections if c.topic == topic]
            found: dict[str, tuple[str, PoseBuffer]] = {}
            for _, _, message in reader.messages(mine):
                parent, child = message.header.frame_id, message.child_frame_id
                fixed, poses = found.setdefault(child, (parent, PoseBuffer(_WHOLE_BAG_S)))
                if fixed == parent and child != parent:
                    poses.add(stamp_to_ns(message.header.stamp), pose_of(message))
            # Of several topics with the same frame, the first is used.
            self._poses = {**found, **self._poses}

    def lift(self, states: TrackedStates) -> TrackedStates | None:
        """Return the states in the odometry's fixed frame, unchanged where there is no odometry.

        The result is None where no pose is known at their time, as before the first odometry.
        """
        if not len(states) or states.frame_id not in self._poses:
            return states
        fixed, poses = self._poses[states.frame_id]
        try:
            return to_fixed_frame(states, poses.at(states.stamp_ns), fixed)
        except FrameError as error:
            self.problem = str(error)
            return None
