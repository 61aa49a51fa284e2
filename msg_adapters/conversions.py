# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversions that all adapters use: headers, yaw, vectors in the object frame, covariances."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msg_adapters.types import Types
from mtpgo_core.errors import ConfigurationError, MessageError
from mtpgo_core.frames import rotate
from mtpgo_core.identity import key_to_int
from mtpgo_core.schema import BoolArray, Float64Array, KeyArray

TWIST_FRAMES = ("default", "object", "header")
"""Frames of a message's velocities: the usual one of its publishers, or one of the two."""

_NANOSECONDS = 1_000_000_000

_UPRIGHT = 1e-6
"""Horizontal part of the x axis up to which a rotation has no yaw; chosen above rounding."""

LAST_S = (1 << 31) - 1
"""Last second of ``builtin_interfaces/Time``."""


@contextmanager
def reading(message: Any, message_type: str) -> Iterator[None]:
    """Report what fails within the block because a message does not have a type's content.

    Args:
        message: what is read.
        message_type: ROS type that it should have.

    Raises:
        MessageError: an attribute is missing, or a value cannot be converted.
    """
    try:
        yield
    except (AttributeError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise MessageError(
            f"message of {type(message).__name__} cannot be read as {message_type}: {error}"
        ) from error


def choose_twist_frame(twist_frame: str, default: str) -> str:
    """Return ``object`` or ``header`` according to the user's choice.

    Raises:
        ConfigurationError: ``twist_frame`` is not in :data:`TWIST_FRAMES`.
    """
    if twist_frame not in TWIST_FRAMES:
        valid = ", ".join(repr(name) for name in TWIST_FRAMES)
        raise ConfigurationError(f"twist_frame is {twist_frame!r}, expected one of {valid}")
    return default if twist_frame == "default" else twist_frame


def stamp_to_ns(stamp: Any) -> int:
    """Return the nanoseconds of a ``builtin_interfaces/Time`` or ``Duration``.

    Raises:
        MessageError: see :func:`stamp_of`.
    """
    return stamp_of(int(stamp.sec), int(stamp.nanosec))


def stamp_of(seconds: int, nanoseconds: int) -> int:
    """Return the nanoseconds of a stamp whose fraction may be more than a second.

    Raises:
        MessageError: it is later than the last one that a message can hold.
    """
    if seconds + nanoseconds // _NANOSECONDS > LAST_S:
        raise MessageError(
            f"stamp is {seconds} s and {nanoseconds} ns, expected less than {LAST_S + 1} s"
        )
    return seconds * _NANOSECONDS + nanoseconds


def make_time(types: Types, stamp_ns: int) -> Any:
    """Return ``builtin_interfaces/Time`` of a stamp (ns)."""
    seconds, nanoseconds = divmod(int(stamp_ns), _NANOSECONDS)
    return types.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)


def make_duration(types: Types, seconds: float) -> Any:
    """Return ``builtin_interfaces/Duration`` of a time span (s)."""
    whole, nanoseconds = divmod(round(seconds * _NANOSECONDS), _NANOSECONDS)
    return types.make("builtin_interfaces/msg/Duration", sec=whole, nanosec=nanoseconds)


def make_header(types: Types, stamp_ns: int, frame_id: str) -> Any:
    """Return ``std_msgs/Header`` of a stamp (ns) and a frame."""
    return types.make("std_msgs/msg/Header", stamp=make_time(types, stamp_ns), frame_id=frame_id)


def table(rows: Sequence[Sequence[float]], columns: int) -> Float64Array:
    """Return rows of numbers as an [n, columns] array, also for n = 0."""
    return np.array(rows, dtype=np.float64).reshape(len(rows), columns)


def finite(values: ArrayLike) -> Float64Array:
    """Return the values with infinities replaced by NaN: both mean unknown."""
    array = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(array), array, np.nan)


def positive(values: ArrayLike) -> Float64Array:
    """Return the values with NaN where not above zero: a box of size zero is unknown."""
    array = finite(values)
    return np.where(array > 0.0, array, np.nan)


def yaw_from_quaternions(quaternion: Float64Array) -> Float64Array:
    """Return [n] the yaw (rad) of [n, 4] quaternions x, y, z, w, NaN where they have none.

    The quaternions need not be normalised. One of zeros is not set, and one that points the x axis
    straight up or down has no yaw.
    """
    quaternion = finite(quaternion)
    largest = np.abs(quaternion).max(axis=-1, keepdims=True, initial=0.0)
    usual = (largest > 1e-100) & (largest < 1e100)  # squares of others would not be numbers
    with np.errstate(invalid="ignore"):
        x, y, z, w = np.moveaxis(quaternion / np.where(usual, 1.0, largest), -1, 0)
    sine, cosine = 2.0 * (w * z + x * y), w * w + x * x - y * y - z * z
    level = np.hypot(sine, cosine) > _UPRIGHT * (x * x + y * y + z * z + w * w)
    return np.where(level, np.arctan2(sine, cosine), np.nan)


def make_quaternion(types: Types, yaw: float) -> Any:
    """Return ``geometry_msgs/Quaternion`` of a yaw (rad); all zero, that is unset, for NaN."""
    if not np.isfinite(yaw):
        return types.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=0.0)
    return types.make(
        "geometry_msgs/msg/Quaternion",
        x=0.0,
        y=0.0,
        z=float(np.sin(yaw / 2.0)),
        w=float(np.cos(yaw / 2.0)),
    )


def make_pose(types: Types, position: Float64Array, z: float, yaw: float) -> Any:
    """Return ``geometry_msgs/Pose`` of [2] position (m), height and yaw; an unknown z is zero."""
    x, y = position
    return types.make(
        "geometry_msgs/msg/Pose",
        position=types.make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=known(z)),
        orientation=make_quaternion(types, yaw),
    )


def make_vector(types: Types, x: float, y: float, z: float = 0.0) -> Any:
    """Return ``geometry_msgs/Vector3``."""
    return types.make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def most_probable(items: Sequence[Any], probability: Callable[[Any], float]) -> Any:
    """Return the item of the highest probability, the first of equal ones, None of none.

    A probability that is not finite is the lowest: compared as a number, NaN would win or lose by
    its place.
    """

    def comparable(item: Any) -> float:
        value = float(probability(item))
        return value if np.isfinite(value) else -np.inf

    return max(items, key=comparable, default=None)


def known(value: float, otherwise: float = 0.0) -> float:
    """Return the value, or ``otherwise`` if it is not finite, for a field without NaN."""
    return float(value) if np.isfinite(value) else otherwise


def pose_row(pose: Any) -> tuple[float, ...]:
    """Return position x, y, z and orientation x, y, z, w of a ``geometry_msgs/Pose``."""
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def small_integer_keys(key: KeyArray, bits: int, where: str) -> list[int]:
    """Return the [n] integers of [n, 4] keys, for a message whose identity is an integer.

    Raises:
        MessageError: a key needs more than ``bits`` bits.
    """
    numbers = [key_to_int(row) for row in key]
    for number in numbers:
        if number >= 1 << bits:
            raise MessageError(
                f"identity {number:#x} does not fit into the {bits}-bit id of {where}"
            )
    return numbers


def to_header_frame(vector: Float64Array, yaw: Float64Array, twist_frame: str) -> Float64Array:
    """Return [n, 2] vectors along the header frame's axes.

    Args:
        vector: [n, 2] along the axes of ``twist_frame``.
        yaw: [n] heading of the objects (rad); NaN makes an object-frame vector unknown.
        twist_frame: ``object`` or ``header``.
    """
    vector = finite(vector)
    return rotate(vector, yaw) if twist_frame == "object" else vector


def state_covariance(
    position: Float64Array, velocity: Float64Array, yaw: Float64Array, twist_frame: str
) -> Float64Array:
    """Return [n, 4, 4] the covariance of (x, y, vx, vy) in the header frame.

    A 2x2 block without two positive variances was not filled by its publisher and is NaN. The
    correlation of position and velocity, which these messages do not have, is zero where both
    blocks are known.

    Args:
        position: [n, 2, 2] (m^2), header frame.
        velocity: [n, 2, 2] (m^2/s^2), along the axes of ``twist_frame``.
        yaw: [n] heading (rad).
        twist_frame: ``object`` or ``header``.
    """
    if twist_frame == "object":
        cos, sin = np.cos(yaw), np.sin(yaw)
        turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
        velocity = turn @ velocity @ np.swapaxes(turn, -1, -2)
    out = np.full((len(position), 4, 4), np.nan)
    has_position, has_velocity = _filled(position), _filled(velocity)
    out[has_position, :2, :2] = position[has_position]
    out[has_velocity, 2:, 2:] = velocity[has_velocity]
    both = has_position & has_velocity
    out[both, :2, 2:] = 0.0
    out[both, 2:, :2] = 0.0
    return out


def turn_velocity(covariance: Float64Array, angle: Float64Array) -> Float64Array:
    """Return [n, 4, 4] covariances with the two velocities rotated by [n] angles (rad)."""
    turn = np.zeros((len(angle), 4, 4))
    turn[:, 0, 0] = turn[:, 1, 1] = 1.0
    turn[:, 2, 2] = turn[:, 3, 3] = np.cos(angle)
    turn[:, 3, 2] = np.sin(angle)
    turn[:, 2, 3] = -turn[:, 3, 2]
    # Block by block, so that an unknown velocity leaves the position's covariance known.
    out = np.full_like(covariance, np.nan)
    rotation = turn[:, 2:, 2:]
    out[:, :2, :2] = covariance[:, :2, :2]
    out[:, 2:, 2:] = rotation @ covariance[:, 2:, 2:] @ np.swapaxes(rotation, 1, 2)
    out[:, 2:, :2] = rotation @ covariance[:, 2:, :2]
    out[:, :2, 2:] = np.swapaxes(out[:, 2:, :2], 1, 2)
    return out


def _filled(block: Float64Array) -> BoolArray:
    variances = np.diagonal(block, axis1=-2, axis2=-1)
    return np.asarray(np.isfinite(block).all((-2, -1)) & (variances > 0.0).all(-1))


def flat36(block: Float64Array) -> NDArray[np.float64]:
    """Return a float64[36] covariance with the [2, 2] block of x and y, zeros if it is unknown."""
    matrix = np.zeros((6, 6))
    if np.isfinite(block).all():
        matrix[:2, :2] = block
    return matrix.reshape(36)


def planar_block(flat: Sequence[float]) -> tuple[float, float, float, float]:
    """Return xx, xy, yx, yy of a float64[36] covariance."""
    return float(flat[0]), float(flat[1]), float(flat[6]), float(flat[7])
