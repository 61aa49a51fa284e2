# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Augmentation of training scenes: mirroring, rotation and scaling.

They work on the finished features by name, and an unknown name is an error, so that no feature is
forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import wrap
from mtpgo_core.scene.scene_builder import LARGEST_SIZE
from mtpgo_core.scene.track_summary import LARGEST_CHANGE, rescaled_noise
from mtpgo_core.schema import Float32Array
from mtpgo_core.task.task_description import (
    CHANGES_ACROSS,
    CHANGES_ALONG,
    CONTEXT_FEATURES,
    NOISE_FEATURES,
)

FloatArray = NDArray[Any]

_PAIRS = (
    ("x", "y"),
    ("vx", "vy"),
    ("ax", "ay"),
    ("cos_yaw", "sin_yaw"),
    ("cos_theta", "sin_theta"),
)
_UNCHANGED = ("in_lane",)
_OF_ROAD = frozenset(CONTEXT_FEATURES["leaders"] + CONTEXT_FEATURES["traffic"])
_NEARNESS = frozenset(name for name in _OF_ROAD if name.endswith("_near"))
_LENGTHS = (_OF_ROAD - _NEARNESS) | {"r"}
_LATERAL = ("d_l", "d_r", "lead1_across")
"""Lateral positions in the lane (``d_l``, see :mod:`mtpgo_core.scene.lane_map`), on the road
(``d_r``) and relative to the agent: mirroring changes their sign."""
_SIDES = {
    name: name.replace("left_", "right_") for name in sorted(_OF_ROAD) if name[:5] == "left_"
}
_SIZES = ("length", "width")
"""Static features that are lengths."""
_DIRECTIONS = ("cos_yaw", "cos_theta")
_ANGLES = {"yaw": 1.0, "theta": -1.0}
"""Angles in radians, and which way they turn: ``theta`` is clockwise, as in the paper."""


@dataclass(frozen=True)
class Augmentation:
    """One random change of a scene.

    Attributes:
        mirror: swap left and right.
        turn_rad: rotation about the scene's origin (rad, counter-clockwise).
        scale: factor on all lengths, and so on speeds and accelerations.
    """

    mirror: bool = False
    turn_rad: float = 0.0
    scale: float = 1.0

    @property
    def is_none(self) -> bool:
        """Whether nothing is changed."""
        return not self.mirror and self.turn_rad == 0.0 and self.scale == 1.0

    def features(self, features: Float32Array, names: tuple[str, ...]) -> Float32Array:
        """Return the [..., F] features named ``names``, changed.

        Raises:
            ConfigurationError: there is no rule for a feature.
        """
        at = {name: i for i, name in enumerate(names)}
        known = {name for pair in _PAIRS for name in pair}
        known |= {
            *_LENGTHS,
            *_NEARNESS,
            *_SIDES,
            *_SIDES.values(),
            *_LATERAL,
            *_ANGLES,
            *_UNCHANGED,
        }
        unknown = sorted(set(names) - known)
        if unknown:
            raise ConfigurationError(
                f"the feature {unknown[0]!r} cannot be augmented, expected one of "
                + ", ".join(sorted(known))
            )
        out = features.copy()
        for first, second in _PAIRS:
            if first in at:
                columns = [at[first], at[second]]
                change = self._directions if first in _DIRECTIONS else self.vectors
                out[..., columns] = change(features[..., columns])
        for name, sign in _ANGLES.items():
            if name in at:
                angle = -features[..., at[name]] if self.mirror else features[..., at[name]]
                out[..., at[name]] = wrap(np.asarray(angle + sign * self.turn_rad, np.float64))
        for name in _LENGTHS:
            if name in at:
                out[..., at[name]] *= self.scale
        for name in _NEARNESS:  # exp(-gap / 20 m) of the agent there, 0 if there is none
            if name in at:
                out[..., at[name]] **= self.scale
                gap = at[name.replace("_near", "_gap")]
                empty = features[..., at[name]] == 0.0
                out[..., gap] = np.where(empty, features[..., gap], out[..., gap])
        if self.mirror:
            for left, right in _SIDES.items():
                if left in at:
                    out[..., [at[left], at[right]]] = out[..., [at[right], at[left]]]
            for name in _LATERAL:
                if name in at:
                    out[..., at[name]] *= -1.0
        return out

    def static(self, static: Float32Array, names: tuple[str, ...]) -> Float32Array:
        """Return [..., C] static features named ``names``, changed.

        Sizes, noise and changes of velocity are lengths, and mirroring turns left into right. An
        unknown one stays 0, and none exceeds the largest that a scene has.
        """
        out = static.copy()
        for i, name in enumerate(names):
            out[..., i] = self._static_column(name, static[..., i])
        return out

    def _static_column(self, name: str, values: Float32Array) -> Float32Array:
        """Return the static feature of this name, changed; a class and a flag stay."""
        if name in NOISE_FEATURES:
            return rescaled_noise(values, self.scale)
        scaled = values * np.float32(self.scale)
        if name in _SIZES:
            return np.minimum(scaled, LARGEST_SIZE)
        if name in CHANGES_ACROSS and self.mirror:
            scaled = -scaled
        if name in CHANGES_ALONG or name in CHANGES_ACROSS:
            return np.clip(scaled, -LARGEST_CHANGE, LARGEST_CHANGE)
        return values

    def trails(self, trails: Float32Array) -> Float32Array:
        """Return [..., 3] trail features, which are in the agents' own frames, changed.

        Ahead and left are lengths, mirroring turns left into right, and the agents' own frames
        turn along. See :func:`mtpgo_core.scene.trails.trail_context.trail_features`.
        """
        side = -self.scale if self.mirror else self.scale
        return trails * np.array([self.scale, side, 1.0], dtype=trails.dtype)

    def vectors(self, vectors: FloatArray) -> FloatArray:
        """Return [..., 2] positions, velocities or accelerations in the scene frame, changed."""
        return self._directions(vectors) * np.asarray(self.scale, dtype=vectors.dtype)

    def _directions(self, vectors: FloatArray) -> FloatArray:
        """Return [..., 2] vectors without a unit, changed."""
        if self.mirror:
            vectors = vectors * np.array([1.0, -1.0], dtype=vectors.dtype)
        if self.turn_rad == 0.0:
            return vectors
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        turned = vectors @ np.array([[c, s], [-s, c]], dtype=vectors.dtype)
        return turned
