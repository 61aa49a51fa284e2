# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transforms objects from the vehicle's frame with the odometry or transforms of the same bag.

The node does the same with ``fixed_frame`` and the topic ``odometry`` or TF, so a bag of its
inputs can be read unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from msg_adapters.bags.bag_definitions import obstacle
from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.conversions import reading, stamp_to_ns
from msg_adapters.inputs.odometry import ODOMETRY, dated_pose, odometry_tilt, pose_of
from mtpgo_core.errors import FrameError, MessageError
from mtpgo_core.frames import PoseBuffer, to_fixed_frame
from mtpgo_core.schema import TrackedStates
from mtpgo_training.data.readers.bags.bag_topics import nearest_first, shared_namespaces
from mtpgo_training.data.readers.bags.bag_transforms import (
    FIXED_FRAMES,
    LONGEST_GAP_S,
    STATIC_TOPIC,
    TRANSFORM_TYPES,
    TRANSFORMS,
    WHOLE_BAG_S,
    TransformTree,
)


def _buffer() -> PoseBuffer:
    return PoseBuffer(WHOLE_BAG_S, max_gap_s=LONGEST_GAP_S)


class BagPoses:
    """The poses in all odometry of a bag, and in its transforms for frames without odometry.

    Args:
        reader: the bag.
        near: topic of the objects. Of frames of the same name, as two robots have them, those of
            its own namespace count.
        fixed_frame: frame into which objects are transformed if the bag tells how; empty for that
            of the odometry, else the usual one of the transforms.
    """

    def __init__(self, reader: DecodingBagReader, near: str = "", fixed_frame: str = "") -> None:
        self._reader, self._near, self._fixed_frame = reader, near, fixed_frame.lstrip("/")
        self._poses: dict[str, tuple[str, PoseBuffer]] = {}
        self._unusable: dict[str, str] = {}
        self._tree: TransformTree | None = None
        self._from_tree: dict[str, tuple[str, PoseBuffer] | None] = {}
        self._odometry = [
            c for c in reader.connections if c.msgtype == ODOMETRY and not obstacle(c)
        ]
        for topic in self._odometry_topics():
            found: dict[str, tuple[str, PoseBuffer]] = {}
            for message in self._messages(topic):
                with self._readable(topic, message, ODOMETRY):
                    parent, child = message.header.frame_id, message.child_frame_id
                    if child in ("", parent):
                        continue
                    fixed, poses = found.setdefault(child, (parent, _buffer()))
                    if fixed == parent:
                        self._add(poses, message)
            # Of several topics with the same frame, the first is used.
            self._poses = {**found, **self._poses}

    def _add(self, poses: PoseBuffer, message: Any) -> None:
        """Add the pose of an odometry, or keep why it is none."""
        tilt = odometry_tilt(message)
        if tilt:
            self._unusable.setdefault(message.child_frame_id, tilt)
            return
        if poses.add(stamp_to_ns(message.header.stamp), pose_of(message)):
            return
        try:
            dated_pose(message, "an odometry")
        except MessageError as error:
            self._unusable.setdefault(message.child_frame_id, str(error))

    def _odometry_topics(self) -> list[str]:
        return nearest_first({connection.topic for connection in self._odometry}, self._near)

    @contextmanager
    def _readable(self, topic: str, message: Any, message_type: str) -> Iterator[None]:
        """Leave out a message that does not have what its type should have."""
        try:
            with reading(message, message_type):
                yield
        except MessageError as error:
            self._reader.tell(
                f"{self._reader.path}, topic {topic}: a message is left out: {error}"
            )

    def _messages(self, topic: str) -> Iterator[Any]:
        """Yield the messages of an odometry topic."""
        wanted = [connection for connection in self._odometry if connection.topic == topic]
        return (message for _, _, message in self._reader.messages(wanted))

    def lift(self, states: TrackedStates) -> TrackedStates:
        """Return the states in a fixed frame, unchanged where the bag tells nothing of theirs.

        Raises:
            FrameError: their frame moves, and no pose is known at their time, as before the first
                odometry.
        """
        if not len(states):
            return states
        found = self._found(states.frame_id)
        if found is None:
            return states
        fixed, poses = found
        frame = states.frame_id.lstrip("/")
        if self._tree is not None and frame in self._tree.unusable:
            raise FrameError(self._tree.unusable[frame])
        try:
            pose = poses.at(states.stamp_ns)
        except FrameError as error:
            reason = self._unusable.get(states.frame_id)
            if reason is None:
                raise
            raise FrameError(f"{error}; {reason}") from error
        return to_fixed_frame(states, pose, fixed)

    def _found(self, frame: str) -> tuple[str, PoseBuffer] | None:
        """Return a fixed frame and the poses of a frame in it, None if the bag tells nothing."""
        by_odometry = self._poses.get(frame)
        wanted = self._fixed_frame
        if by_odometry is None:
            return self._transforms(frame)
        if wanted in ("", by_odometry[0].lstrip("/")):
            return by_odometry
        by_tree = self._transforms(frame)
        return by_tree if by_tree is not None and by_tree[0] == wanted else by_odometry

    def is_apart(self, frame: str) -> bool:
        """Return whether the bag's transforms tell how frames move, but nothing of this one."""
        return self._tree is not None and self._tree.is_apart(frame)

    def _transforms(self, frame: str) -> tuple[str, PoseBuffer] | None:
        """Return the fixed frame and poses that the bag's transforms give for a frame."""
        if frame.lstrip("/") in FIXED_FRAMES and self._fixed_frame in ("", frame.lstrip("/")):
            return None  # without reading any
        if frame not in self._from_tree:
            self._tree = self._tree or self._read_tree()
            self._from_tree[frame] = self._tree.poses(frame, self._fixed_frame)
        return self._from_tree[frame]

    def _read_tree(self) -> TransformTree:
        reader = self._reader
        wanted = [
            c for c in reader.connections if c.msgtype in TRANSFORM_TYPES and not obstacle(c)
        ]
        tree = TransformTree()
        near = {id(c): shared_namespaces(c.topic, self._near) for c in wanted}
        for level in sorted(set(near.values()), reverse=True):
            known = tree.frames
            own = [c for c in wanted if near[id(c)] == level]
            for connection, _, message in reader.messages(own):
                with self._readable(connection.topic, message, TRANSFORMS):
                    tree.add(connection.topic.endswith(STATIC_TOPIC), message, known)
        # A sensor's frame may be fixed to a vehicle whose pose is in the odometry alone.
        for topic in self._odometry_topics():
            missing: dict[str, bool] = {}
            for message in self._messages(topic):
                with self._readable(topic, message, ODOMETRY):
                    child = message.child_frame_id
                    if missing.setdefault(child, not tree.has(child)):
                        tree.add_odometry(message)
        return tree
