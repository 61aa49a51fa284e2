# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The arrays that pass through the project, from the adapter to the published prediction.

All axes are named here: ``n`` tracked agents of a message or window, ``T`` history steps,
``H`` horizon steps, ``M`` modes, ``B`` scenes (graphs), ``N`` agents of a scene, ``F`` features.
All lengths are metres, times seconds (stamps: integer nanoseconds), angles radians counted
counter-clockwise from +x, and every frame is right-handed with y to the left. What is unknown is
NaN, never zero.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
KeyArray = NDArray[np.uint32]
ClassArray = NDArray[np.uint8]
IndexArray = NDArray[np.intp]

FARTHEST_M = 1e8
"""Coordinates beyond are invalid (m): UTM coordinates stay below 1e7 m."""

LARGEST_SIZE_M = 1000.0
"""Lengths and widths beyond are invalid (m); chosen above the longest trains."""

MOVING_MPS = 0.5
"""Above this speed (m/s) the velocity gives the direction of motion, up to it the yaw; chosen
above a tracker's velocity noise at standstill."""


class AgentClass(IntEnum):
    """Road-user classes; 0 to 8 equal the labels of autoware_perception_msgs."""

    UNKNOWN = 0
    CAR = 1
    TRUCK = 2
    BUS = 3
    TRAILER = 4
    MOTORCYCLE = 5
    BICYCLE = 6
    PEDESTRIAN = 7
    ANIMAL = 8
    VAN = 9

    @classmethod
    def from_name(cls, name: str) -> AgentClass:
        """Return the class of a data set's or detector's name, ``UNKNOWN`` for an unknown name."""
        return _CLASS_BY_NAME.get(name.strip().lower(), cls.UNKNOWN)

    @classmethod
    def from_code(cls, code: int) -> AgentClass:
        """Return the class of a number in a message, ``UNKNOWN`` for one that no class has."""
        return cls(code) if 0 <= code < len(cls) else cls.UNKNOWN


_SINGULAR = {member.name.lower(): member for member in AgentClass} | {
    "truck_bus": AgentClass.TRUCK,
    "motorbike": AgentClass.MOTORCYCLE,
    "bike": AgentClass.BICYCLE,
    "bicyclist": AgentClass.BICYCLE,
    "cyclist": AgentClass.BICYCLE,
    "motorcyclist": AgentClass.MOTORCYCLE,
    "person": AgentClass.PEDESTRIAN,
}

_CLASS_BY_NAME = (
    _SINGULAR
    | {f"{name}s": member for name, member in _SINGULAR.items()}
    | {"buses": AgentClass.BUS, "people": AgentClass.PEDESTRIAN}
)
"""Classes by their names, in the singular and the plural."""


class Source(IntEnum):
    """Origin of a prediction; part of every published point."""

    MODEL = 0
    CONSTANT_VELOCITY = 1
    PREFERRED_CONSTANT_VELOCITY = 2
    """Constant velocity in place of a model that has been worse on road users of this group."""
    OTHER = 3
    """Read from a message that does not say; the predictor never publishes it."""


class CalibrationStage(IntEnum):
    """What was applied to the model's prediction; part of every published point."""

    NONE = 0
    SHIPPED = 1
    """The calibration in the model's file."""
    ONLINE = 2
    """That one, and factors on the covariances learned from what became of earlier predictions."""
    ONLINE_PATH = 3
    """Those, and the path was corrected by what was learned."""


@dataclass(frozen=True)
class TrackedStates:
    """Tracked road users at one instant, in one frame.

    Attributes:
        stamp_ns: time of the observation (ns since epoch of the stream's clock).
        frame_id: frame in which all vectors below are expressed.
        key: [n, 4] 128-bit identity as four words, see :mod:`mtpgo_core.identity`.
        agent_class: [n] :class:`AgentClass` values.
        position: [n, 2] box centre x, y (m).
        z: [n] height of the box centre (m), NaN where unknown.
        velocity: [n, 2] over ground, along the frame's axes (m/s), NaN where unknown.
        acceleration: [n, 2] over ground, along the frame's axes (m/s^2), NaN where unknown.
        yaw: [n] heading of the box (rad), NaN where unknown.
        size: [n, 2] length, width (m), NaN where unknown.
        covariance: [n, 4, 4] of (x, y, vx, vy), NaN where the tracker gives none.
    """

    stamp_ns: int
    frame_id: str
    key: KeyArray
    agent_class: ClassArray
    position: Float64Array
    z: Float64Array
    velocity: Float64Array
    acceleration: Float64Array
    yaw: Float64Array
    size: Float64Array
    covariance: Float64Array

    def __len__(self) -> int:
        return self.key.shape[0]


def tracked_states(
    stamp_ns: int,
    frame_id: str,
    key: KeyArray,
    position: Float64Array,
    *,
    agent_class: ClassArray | None = None,
    z: Float64Array | None = None,
    velocity: Float64Array | None = None,
    acceleration: Float64Array | None = None,
    yaw: Float64Array | None = None,
    size: Float64Array | None = None,
    covariance: Float64Array | None = None,
) -> TrackedStates:
    """Return tracked states in which everything that is not given is unknown.

    Args:
        stamp_ns: time of the observation (ns).
        frame_id: frame of the vectors.
        key: [n, 4] identities.
        position: [n, 2] (m).
        agent_class: [n], default unknown.
        z: [n] (m), default NaN, as for all that follow.
        velocity: [n, 2] (m/s).
        acceleration: [n, 2] (m/s^2).
        yaw: [n] (rad).
        size: [n, 2] length, width (m).
        covariance: [n, 4, 4] of (x, y, vx, vy).
    """
    n = key.shape[0]

    def known(value: Float64Array | None, *shape: int) -> Float64Array:
        if value is None:
            return np.full((n, *shape), np.nan)
        return np.ascontiguousarray(value, dtype=np.float64).reshape(n, *shape)

    return TrackedStates(
        stamp_ns=int(stamp_ns),
        frame_id=frame_id,
        key=np.ascontiguousarray(key, dtype=np.uint32).reshape(n, 4),
        agent_class=(
            np.zeros(n, dtype=np.uint8)
            if agent_class is None
            else np.ascontiguousarray(agent_class, dtype=np.uint8)
        ),
        position=known(position, 2),
        z=known(z),
        velocity=known(velocity, 2),
        acceleration=known(acceleration, 2),
        yaw=known(yaw),
        size=known(size, 2),
        covariance=known(covariance, 4, 4),
    )


@dataclass(frozen=True)
class HistoryWindow:
    """The last ``T`` grid samples of every agent seen within them, at the common time t.

    Sample ``T - 1`` is at ``stamp_ns``, sample i at ``stamp_ns - (T - 1 - i) * dt``. Where
    ``valid`` is false the values are NaN; where it is true the position is known, while velocity,
    acceleration and yaw are NaN for an agent of which they were never known (for example, one
    observation without a velocity).

    Attributes:
        stamp_ns: the common time t (ns).
        frame_id: the fixed frame.
        key: [n, 4], agent_class: [n], z: [n], size: [n, 2] as in :class:`TrackedStates`.
        position: [n, T, 2] (m). velocity: [n, T, 2] (m/s). acceleration: [n, T, 2] (m/s^2).
        yaw: [n, T] (rad), in (-pi, pi].
        valid: [n, T] the agent was present at that sample.
        covariance: [n, 4, 4] the tracker's, of (x, y, vx, vy) at t, NaN where unknown.
    """

    stamp_ns: int
    frame_id: str
    key: KeyArray
    agent_class: ClassArray
    z: Float64Array
    size: Float64Array
    position: Float64Array
    velocity: Float64Array
    acceleration: Float64Array
    yaw: Float64Array
    valid: BoolArray
    covariance: Float64Array

    def __len__(self) -> int:
        return self.key.shape[0]

    def select(self, index: IndexArray | BoolArray) -> HistoryWindow:
        """Return the window of the agents at ``index`` (integer positions or a mask)."""
        return HistoryWindow(
            stamp_ns=self.stamp_ns,
            frame_id=self.frame_id,
            key=self.key[index],
            agent_class=self.agent_class[index],
            z=self.z[index],
            size=self.size[index],
            position=self.position[index],
            velocity=self.velocity[index],
            acceleration=self.acceleration[index],
            yaw=self.yaw[index],
            valid=self.valid[index],
            covariance=self.covariance[index],
        )


@dataclass(frozen=True)
class SceneBatch:
    """Graphs ready for the model: B scenes of up to N agents, padded.

    Attributes:
        features: [B, N, T, F] float32 in the scene frame, zero where not valid.
        valid: [B, N, T] presence; all false for padding.
        static: [B, N, C] float32 one-hot class, all zero for a class the model does not know, and
            size (``SceneConfig.static_features``).
        origin: [B, 2] float64 origin of the scene frame in the fixed frame (m).
        rotation: [B] angle from the fixed frame's x axis to the scene frame's (rad).
        agent: [B, N] position in the window, -1 for padding.
        primary: [B, N] true where this graph's prediction is the agent's published one; every
            agent valid at t is primary exactly once.
        trails: [B, N, R, H, 3] float32 continuations of the agents' ways in their own frames, see
            :func:`mtpgo_core.scene.trails.trail_context.trail_features`; None where the task has
            none.
    """

    features: Float32Array
    valid: BoolArray
    static: Float32Array
    origin: Float64Array
    rotation: Float64Array
    agent: NDArray[np.int64]
    primary: BoolArray
    trails: Float32Array | None = None


@dataclass(frozen=True)
class Prediction:
    """Multimodal Gaussian predictions in the fixed frame, modes sorted by descending weight.

    Attributes:
        stamp_ns: time of the observation that the prediction starts from (ns).
        frame_id: the fixed frame.
        key: [n, 4], agent_class: [n], z: [n], size: [n, 2] as in :class:`TrackedStates`.
        initial: [n, 4] x, y, vx, vy at ``stamp_ns`` (m, m/s), velocity 0 where never known.
        initial_yaw: [n] (rad), 0 where never known.
        time_s: [H] seconds after ``stamp_ns``.
        weight: [n, M] float64, sums to 1 over the modes (Gaussian mixture, eq. (26)).
        mean: [n, M, H, 4] x, y, vx, vy (m, m/s).
        yaw: [n, M, H] direction of motion; at standstill the last known yaw (rad).
        covariance: [n, M, H, 2, 2] of the position (m^2).
        source: [n] :class:`Source` values.
        sigma_factor_50: [n, H] factor on the standard deviations for the 50 % ellipse, 1 where it
            is not given for these agents and steps. ``covariance`` is that of a Gaussian whose
            90 % ellipse holds 90 %; errors have heavier tails than that Gaussian, so its 50 %
            ellipse holds more than 50 %.
        calibration: [n] :class:`CalibrationStage` values, ``NONE`` where not given.
    """

    stamp_ns: int
    frame_id: str
    key: KeyArray
    agent_class: ClassArray
    z: Float64Array
    size: Float64Array
    initial: Float64Array
    initial_yaw: Float64Array
    time_s: Float64Array
    weight: Float64Array
    mean: Float64Array
    yaw: Float64Array
    covariance: Float64Array
    source: NDArray[np.uint8]
    sigma_factor_50: Float64Array = field(default_factory=lambda: np.empty((0, 0)))
    calibration: NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, dtype=np.uint8))

    def __post_init__(self) -> None:
        n, steps = self.key.shape[0], len(self.time_s)
        if self.sigma_factor_50.shape != (n, steps):
            object.__setattr__(self, "sigma_factor_50", np.ones((n, steps)))
        if self.calibration.shape != (n,):
            object.__setattr__(self, "calibration", np.zeros(n, dtype=np.uint8))

    def __len__(self) -> int:
        return self.key.shape[0]
