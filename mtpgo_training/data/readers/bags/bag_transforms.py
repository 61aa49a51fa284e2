# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The poses of moving frames in a fixed one, from the transforms on /tf and /tf_static."""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.conversions import stamp_to_ns, yaw_from_quaternions
from msg_adapters.inputs.odometry import LEAST_UPRIGHT, tilt_problem
from mtpgo_core.frames import Pose2, PoseBuffer, moves_with_vehicle
from mtpgo_core.schema import BoolArray, Float64Array

TRANSFORMS = "tf2_msgs/msg/TFMessage"
TRANSFORM_TYPES = (TRANSFORMS, "tf/msg/tfMessage")
"""Types of messages of transforms: the second one, of the first versions of ROS 1, is the same."""

STATIC_TOPIC = "/tf_static"

FIXED_FRAMES = ("map", "odom", "world", "earth")
"""Usual names of fixed frames, in the order in which objects are transformed into one (REP 105).
The earth's comes last: its axes are not level with the ground."""

WHOLE_BAG_S = 1e9
"""Time over which poses are kept (s): longer than any bag."""

LONGEST_GAP_S = 2.5
"""Between two poses farther apart than this no pose is known (s); chosen: those of 0.5 Hz are
interpolated, and a vehicle that turns is not drawn straight for longer."""

_MOVED_M, _MOVED_RAD = 1.0, 0.1
"""A transform that changes by less over a gap (m, rad) is interpolated all the same, as that of a
localisation which corrects the odometry now and then; chosen."""


@dataclass
class _Edge:
    """The transforms of one frame into its parent.

    Attributes:
        parent: the parent frame.
        static: they come from the topic of static transforms; the last one counts.
        stamps: their times (ns).
        values: position (m) and quaternion x, y, z, w of each.
    """

    parent: str
    static: bool
    stamps: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)

    def at(self, stamp_ns: NDArray[np.int64]) -> tuple[Float64Array, Float64Array]:
        """Return [t, 3] positions and [t, 4] unit quaternions at times inside of the edge's."""
        if self.static:
            values = np.repeat(np.array(self.values[-1:], dtype=np.float64), len(stamp_ns), axis=0)
            return values[:, :3], _unit(values[:, 3:])
        stamps, values = self._in_order()
        right = np.clip(np.searchsorted(stamps, stamp_ns), min(1, len(stamps) - 1), None)
        left = np.maximum(right - 1, 0)
        span = np.maximum(stamps[right] - stamps[left], 1)
        share = ((stamp_ns - stamps[left]) / span)[:, None]
        before, after = _unit(values[left, 3:]), _unit(values[right, 3:])
        # Both signs of a quaternion are the same rotation: the shorter arc.
        after = np.where((before * after).sum(axis=1, keepdims=True) < 0.0, -after, after)
        position = values[left, :3] + share * (values[right, :3] - values[left, :3])
        return position, _unit(before + share * (after - before))

    def is_known(self, stamp_ns: NDArray[np.int64]) -> BoolArray:
        """Return [t] whether times inside of the edge's are in none of its long gaps."""
        if self.static:
            return np.ones(len(stamp_ns), dtype=np.bool_)
        stamps, values = self._in_order()
        moved_m = np.linalg.norm(np.diff(values[:, :3], axis=0), axis=1)
        turns = _unit(values[:, 3:])
        cosine = np.abs((turns[1:] * turns[:-1]).sum(axis=1))
        turned_rad = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        long = np.diff(stamps) * 1e-9 > LONGEST_GAP_S
        long &= (moved_m > _MOVED_M) | (turned_rad > _MOVED_RAD)
        right = np.searchsorted(stamps, stamp_ns)
        at_one = stamps[np.minimum(right, len(stamps) - 1)] == stamp_ns
        within = np.clip(right - 1, 0, max(0, len(long) - 1))
        return np.asarray(at_one | ~long[within] if len(long) else np.ones_like(at_one))

    def _in_order(self) -> tuple[NDArray[np.int64], Float64Array]:
        """Return the times in order, each once (ns), and their values."""
        stamps, first = np.unique(np.array(self.stamps, dtype=np.int64), return_index=True)
        return stamps, np.array(self.values, dtype=np.float64)[first]


class TransformTree:
    """The transforms of a bag.

    Attributes:
        unusable: why no pose of a frame can be used, where that is so.
    """

    def __init__(self) -> None:
        self.unusable: dict[str, str] = {}
        self._edges: dict[str, _Edge] = {}
        self._parents: dict[str, dict[tuple[str, bool], _Edge]] = {}

    @property
    def frames(self) -> frozenset[str]:
        """The frames that have a transform into another one."""
        return frozenset(self._edges)

    def add(self, static: bool, message: Any, known: Container[str] = ()) -> None:
        """Add the transforms of a tf2_msgs/TFMessage.

        Args:
            static: it comes from the topic of static transforms.
            message: the message.
            known: frames whose transforms are left out.
        """
        for item in message.transforms:
            if str(item.child_frame_id).lstrip("/") not in known:
                self._add(static, item)

    def has(self, frame: str) -> bool:
        """Return whether there is a transform of a frame into another one."""
        return frame.lstrip("/") in self._edges

    def add_odometry(self, message: Any) -> None:
        """Add the pose of a nav_msgs/Odometry, a transform of its child frame."""
        pose = message.pose.pose
        self._add_pose(message, pose.position, pose.orientation, static=False)

    def _add(self, static: bool, item: Any) -> None:
        transform = item.transform
        self._add_pose(item, transform.translation, transform.rotation, static=static)

    def _add_pose(self, item: Any, position: Any, rotation: Any, *, static: bool) -> None:
        parent = str(item.header.frame_id).lstrip("/")
        child = str(item.child_frame_id).lstrip("/")
        value = (
            *(position.x, position.y, position.z),
            *(rotation.x, rotation.y, rotation.z, rotation.w),
        )
        known = all(map(math.isfinite, value)) and any(value[3:])
        if not child or parent == child or not known:
            return
        # Two publishers may give one frame two parents: the better known one counts.
        parents = self._parents.setdefault(child, {})
        edge = parents.setdefault((parent, static), _Edge(parent, static))
        edge.stamps.append(stamp_to_ns(item.header.stamp))
        edge.values.append(value)
        self._edges[child] = max(parents.values(), key=_trust)

    def is_apart(self, frame: str) -> bool:
        """Return whether some frames move by the transforms, but this one is not connected.

        It is the frame of a sensor whose mounting is missing, a fixed frame of its own, or part of
        a loop.
        """
        root = frame.lstrip("/")
        ancestors, _, is_loop = self._ancestors(root)
        if is_loop and not set(FIXED_FRAMES) & set(ancestors):
            return True
        passed = {root}
        while root in self._edges and self._edges[root].static:
            root = self._edges[root].parent
            if root in passed:
                break
            passed.add(root)
        moving = {name: edge.parent for name, edge in self._edges.items() if not edge.static}
        known = {"", *FIXED_FRAMES, *moving, *moving.values()}
        return bool(moving) and root not in known

    def poses(self, frame: str, wanted: str = "") -> tuple[str, PoseBuffer] | None:
        """Return a fixed frame and the poses of a frame in it; None if the frame does not move.

        The fixed frame is the one wanted or the first of :data:`FIXED_FRAMES` among the frame's
        ancestors, else the last ancestor; in a loop there is none. Where that one moves with a
        vehicle by its name, a usual fixed frame below it is taken. A frame that has one of these
        names, unless another one is wanted, or that only static transforms lead away from, is
        fixed itself.

        Args:
            frame: the frame.
            wanted: name of a fixed frame.
        """
        frame = frame.lstrip("/")
        ancestors, chain, is_loop = self._ancestors(frame)
        usual = frame in FIXED_FRAMES and wanted not in ancestors[1:]
        if usual or frame == wanted:
            return None
        fixed = next((name for name in (wanted, *FIXED_FRAMES) if name in ancestors), "")
        down: list[_Edge] = []
        if not fixed and not is_loop and moves_with_vehicle(ancestors[-1]):
            fixed, down = self._below(ancestors[-1], wanted)
        if all(edge.static for edge in (*chain, *down)) or (is_loop and not fixed):
            return None
        fixed = fixed or ancestors[-1]
        if not down:
            chain = chain[: ancestors.index(fixed)]
        poses, upright = _composed(chain, down)
        if not len(poses):
            self.unusable[frame] = (
                f"the transforms from frame {frame!r} to {fixed!r} have no time in common"
            )
        elif upright < LEAST_UPRIGHT:
            self.unusable[frame] = tilt_problem(frame, fixed, upright)
        return fixed, poses

    def _below(self, root: str, wanted: str) -> tuple[str, list[_Edge]]:
        """Return the first fixed frame that has a frame as its last ancestor, and the edges."""
        for name in (wanted, *FIXED_FRAMES):
            ancestors, chain, is_loop = self._ancestors(name)
            if chain and not is_loop and ancestors[-1] == root:
                return name, chain
        return "", []

    def _ancestors(self, frame: str) -> tuple[list[str], list[_Edge], bool]:
        """Return a frame with its ancestors, the edges between them, and if they are a loop."""
        ancestors: list[str] = [frame]
        chain: list[_Edge] = []
        while ancestors[-1] in self._edges:
            edge = self._edges[ancestors[-1]]
            if edge.parent in ancestors:
                return ancestors, chain, True
            chain.append(edge)
            ancestors.append(edge.parent)
        return ancestors, chain, False


def _trust(edge: _Edge) -> tuple[bool, int]:
    """Return the sort key by which the preferred parent of a frame is chosen."""
    return edge.parent in FIXED_FRAMES, len(edge.stamps)


def _composed(up: list[_Edge], down: list[_Edge]) -> tuple[PoseBuffer, float]:
    """Return the poses over chains of transforms, at every time of any of them.

    With them the vertical component of the frame's z axis, usually.

    Args:
        up: from the frame to an ancestor.
        down: from the fixed frame to the same ancestor, none where that is the fixed frame.
    """
    chain = [*up, *down]
    moving = [np.array(edge.stamps, dtype=np.int64) for edge in chain if not edge.static]
    poses = PoseBuffer(WHOLE_BAG_S, max_extrapolation_s=0.0, max_gap_s=LONGEST_GAP_S)
    if not moving:
        moving = [np.zeros(1, dtype=np.int64)]
    stamps = np.unique(np.concatenate(moving))
    # Outside the times of one of them, the pose is unknown.
    first, last = max(stamp.min() for stamp in moving), min(stamp.max() for stamp in moving)
    stamps = stamps[(stamps >= first) & (stamps <= last)]
    stamps = stamps[np.all([edge.is_known(stamps) for edge in chain], axis=0)]
    position, rotation = _in_ancestor(up, stamps)
    if down:
        origin, turn = _in_ancestor(down, stamps)
        back = turn * (-1.0, -1.0, -1.0, 1.0)
        position, rotation = _rotated(back, position - origin), _product(back, rotation)
    yaw = yaw_from_quaternions(rotation)
    for stamp, (x, y), angle in zip(
        stamps.tolist(), position[:, :2].tolist(), yaw.tolist(), strict=True
    ):
        poses.add(stamp, Pose2(x=x, y=y, yaw=angle))
    upright = 1.0 - 2.0 * (rotation[:, 0] ** 2 + rotation[:, 1] ** 2)
    return poses, float(np.median(upright)) if len(upright) else 1.0


def _in_ancestor(
    chain: list[_Edge], stamp_ns: NDArray[np.int64]
) -> tuple[Float64Array, Float64Array]:
    """Return [t, 3] positions and [t, 4] unit quaternions of a frame in its ancestor."""
    position = np.zeros((len(stamp_ns), 3))
    rotation = np.tile((0.0, 0.0, 0.0, 1.0), (len(stamp_ns), 1))
    for edge in chain:
        shift, turn = edge.at(stamp_ns)
        position = shift + _rotated(turn, position)
        rotation = _product(turn, rotation)
    return position, rotation


def _unit(quaternion: Float64Array) -> Float64Array:
    """Return [t, 4] quaternions of length one."""
    return quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)


def _product(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return [t, 4] the rotation by ``b`` and then by ``a``."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - (a[:, :3] * b[:, :3]).sum(axis=1)
    return np.column_stack([vector, scalar])


def _rotated(quaternion: Float64Array, vector: Float64Array) -> Float64Array:
    """Return [t, 3] vectors rotated by [t, 4] quaternions."""
    axis, scalar = quaternion[:, :3], quaternion[:, 3:]
    once = 2.0 * np.cross(axis, vector)
    return vector + scalar * once + np.cross(axis, once)
