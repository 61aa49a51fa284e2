# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Changes of a training scene that leave its meaning: a mirror image, a turn, another scale.

Both work on the finished features by their names, so that no feature can be forgotten: an unknown
name is an error, not a silent omission.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import Float32Array
from mtpgo_core.task.task_description import CONTEXT_FEATURES

FloatArray = NDArray[Any]

_PAIRS = (
    ("x", "y"),
    ("vx", "vy"),
    ("ax", "ay"),
    ("cos_yaw", "sin_yaw"),
    ("cos_theta", "sin_theta"),
)
_OF_ROAD = frozenset(CONTEXT_FEATURES["leaders"] + CONTEXT_FEATURES["traffic"])
_NEARNESS = frozenset(name for name in _OF_ROAD if name.endswith("_near"))
_LENGTHS = (_OF_ROAD - _NEARNESS) | {"r"}
_TO_THE_LEFT = ("lead1_across",)
_SIDES = {
    "d_l": "d_r",
    **{name: name.replace("left_", "right_") for name in sorted(_OF_ROAD) if name[:5] == "left_"},
}
_DIRECTIONS = ("cos_yaw", "cos_theta")


@dataclass(frozen=True)
class Augmentation:
    """One draw.

    Attributes:
        mirror: swap left and right.
        turn_rad: turn about the scene's origin (rad, counter-clockwise).
        scale: factor on all lengths, and so on speeds and accelerations.
    """

    mirror: bool = False
    turn_rad: float = 0.0
    scale: float = 1.0

    @property
    def is_none(self) -> bool:
        """Nothing is changed."""
        return not self.mirror and self.turn_rad == 0.0 and self.scale == 1.0

    def features(self, features: Float32Array, names: tuple[str, ...]) -> Float32Array:
        """[..., F] features named ``names``, changed.

        Raises:
            ConfigurationError: a feature of which it is not known how it changes.
        """
        at = {name: i for i, name in enumerate(names)}
        known = {name for pair in _PAIRS for name in pair}
        known |= {*_LENGTHS, *_NEARNESS, *_SIDES, *_SIDES.values()}
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
        for name in _LENGTHS:
            if name in at:
                out[..., at[name]] *= self.scale
        for name in _NEARNESS:  # exp(-gap / 20 m) where somebody is, else 0
            if name in at:
                out[..., at[name]] **= self.scale
                gap = at[name.replace("_near", "_gap")]
                nobody = features[..., at[name]] == 0.0
                out[..., gap] = np.where(nobody, features[..., gap], out[..., gap])
        if self.mirror:
            for left, right in _SIDES.items():
                if left in at:
                    out[..., [at[left], at[right]]] = out[..., [at[right], at[left]]]
            for name in _TO_THE_LEFT:
                if name in at:
                    out[..., at[name]] *= -1.0
        return out

    def vectors(self, vectors: FloatArray) -> FloatArray:
        """[..., 2] positions, velocities or accelerations in the scene frame, changed."""
        return self._directions(vectors) * np.asarray(self.scale, dtype=vectors.dtype)

    def _directions(self, vectors: FloatArray) -> FloatArray:
        """[..., 2] vectors without a unit, changed."""
        if self.mirror:
            vectors = vectors * np.array([1.0, -1.0], dtype=vectors.dtype)
        if self.turn_rad == 0.0:
            return vectors
        c, s = np.cos(self.turn_rad), np.sin(self.turn_rad)
        turned = vectors @ np.array([[c, s], [-s, c]], dtype=vectors.dtype)
        return turned
