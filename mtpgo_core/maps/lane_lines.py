# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of a map file in metres, and the checks that all readers share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import FARTHEST_M, Float64Array

MOST_POINTS = 1_000_000
"""Most points of all lane lines of a file; chosen: 1000 km of lines with a point each metre."""

LONGEST_M = 20_000.0
"""Longest distance of two consecutive points of a line (m); chosen: a longer one is no lane but a
mistaken coordinate."""

_SAME_M = 1e-3
"""Points nearer than this to the one before are left out (m); chosen: they have no direction."""


@dataclass(frozen=True)
class LaneLines:
    """Lane lines of a file.

    Attributes:
        path: the file.
        kind: kind of the file.
        lines: polylines [k, 2] (m), k >= 2, along the direction of travel.
        lanes: number and kind of the elements that were read, such as ``12 lanelets``.
        left_out: number of other elements in the file, by kind.
        sha256: of the file.
    """

    path: Path
    kind: str
    lines: tuple[Float64Array, ...]
    lanes: str
    left_out: Mapping[str, int] = field(default_factory=dict)
    sha256: str = ""

    @property
    def sentence(self) -> str:
        """What was read."""
        points = sum(map(len, self.lines))
        rest = ", ".join(f"{number} {what}" for what, number in self.left_out.items() if number)
        return (
            f"{self.path} ({self.kind}): {len(self.lines)} lane lines with {points} points from"
            f" {self.lanes}{f'; left out: {rest}' if rest else ''}"
        )


def usable_line(points: Float64Array, path: Path, place: str) -> Float64Array | None:
    """Return [k, 2] a line without repeated points (m), None if fewer than two points remain.

    Args:
        points: [k, 2] (m).
        path: the file.
        place: where in the file the line is.

    Raises:
        ConfigurationError: a point is not finite, or too far from the one before.
    """
    if not (np.abs(points) <= FARTHEST_M).all():
        raise ConfigurationError(
            f"{path}, {place}: a point is not finite, or beyond {FARTHEST_M:g} m"
        )
    step = np.hypot(*np.diff(points, axis=0).T)
    if len(step) and step.max() > LONGEST_M:
        raise ConfigurationError(
            f"{path}, {place}: two consecutive points are {step.max() * 1e-3:.4g} km apart,"
            f" expected at most {LONGEST_M * 1e-3:g} km"
        )
    line: Float64Array = points[np.append(True, step > _SAME_M)]
    return line if len(line) > 1 else None


def require_fewer(number: int, path: Path) -> None:
    """Raise ConfigurationError if a file has too many points of lane lines."""
    if number > MOST_POINTS:
        raise ConfigurationError(
            f"{path} has {number} points of lane lines, expected at most {MOST_POINTS}: cut the"
            " map to the area of use"
        )


def beside(line: Float64Array, left_m: float) -> Float64Array:
    """Return [k, 2] a line moved to its left (m), corners mitred."""
    along = np.diff(line, axis=0)
    along /= np.hypot(along[:, 0], along[:, 1])[:, None]
    before, after = np.vstack([along[:1], along]), np.vstack([along, along[-1:]])
    middle = before + after
    middle /= np.maximum(np.hypot(middle[:, 0], middle[:, 1]), 1e-9)[:, None]
    # At a corner the mitre is longer than the shift, at most by a half.
    reach = left_m / np.maximum((middle * after).sum(axis=1), 2.0 / 3.0)
    return line + reach[:, None] * np.stack([-middle[:, 1], middle[:, 0]], axis=1)
