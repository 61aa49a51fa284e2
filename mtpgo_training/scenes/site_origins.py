# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The origin of a site, found in its recordings.

The paper's origins are the centre of a roundabout and the point where the roads of a junction
meet. Both are where lines intersect, in the sense of least squares: the lines along which road
users drive through a junction, and the normals of their ways around a roundabout.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import wrap
from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.data.recording import Recording

LEAST_MPS = 1.5
"""Speed below which a velocity has no usable direction (m/s); chosen."""

TURN_OVER_S = 1.0
"""Time over which a turn is measured (s); chosen: shorter ones show the tracker's jitter."""

RADII_M = (4.0, 60.0)
"""Radii of ways around a roundabout (m); chosen: wider ways are those on straight roads."""

NEAR_M = 3.0
"""Distance from the origin at which a line counts half (m); chosen: about the width of a lane."""

ROUNDS = 30
"""Rounds of reweighting; chosen: the origin no longer moves."""


def find_origin(recordings: Sequence[Recording], kind: str) -> tuple[float, float]:
    """Return the origin of a site in the fixed frame (m), rounded to a centimetre.

    Args:
        recordings: of this site.
        kind: ``roundabout`` or ``junction``.

    Raises:
        ConfigurationError: too little traffic drives on roads of different directions.
    """
    parts = [_lines(recording) for recording in recordings]
    position, direction, curvature = (
        np.concatenate([part[i] for part in parts]) for i in range(3)
    )
    if kind == "junction":
        normal = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
        origin, _ = _intersection(position, normal)
    else:
        # Around a roundabout all road users turn to the same side, at entry and exit to the other.
        bend = np.abs(curvature)
        turning = (bend > 1.0 / RADII_M[1]) & (bend < 1.0 / RADII_M[0])
        fits = [
            _intersection(position[some], direction[some])
            for some in (turning & (curvature > 0.0), turning & (curvature < 0.0))
        ]
        origin, _ = min(fits, key=lambda fit: fit[1])
    if not np.isfinite(origin).all():
        raise ConfigurationError(
            f"no origin is found for the site {recordings[0].location!r}, expected traffic in "
            "different directions; give it in scene.site_origins"
        )
    return round(float(origin[0]), 2), round(float(origin[1]), 2)


def _intersection(position: Float64Array, normal: Float64Array) -> tuple[Float64Array, float]:
    """Return the point [2] nearest to lines, and their median distance from it (m).

    Lines that pass far from it count less and less (weights 1 / (1 + (distance / NEAR_M)^2)).

    Args:
        position: [n, 2] a point of each line (m).
        normal: [n, 2] unit vector at right angles to each line.
    """
    weight = np.ones(len(position))
    offset = (normal * position).sum(axis=1)
    origin, distance = np.full(2, np.nan), np.full(1, np.inf)
    for _ in range(ROUNDS):
        matrix = np.einsum("n,nk,nl->kl", weight, normal, normal)
        if len(position) < 2 or np.linalg.cond(matrix) > 1e3:
            return np.full(2, np.nan), np.inf
        origin = np.linalg.solve(matrix, (weight * offset) @ normal)
        distance = np.abs(normal @ origin - offset)
        weight = 1.0 / (1.0 + (distance / NEAR_M) ** 2)
    return origin, float(np.median(distance))


def _lines(recording: Recording) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return positions [n, 2] (m), directions [n, 2] and curvatures [n] (1/m) of moving traffic.

    One each second of a track; the curvature is positive to the left.
    """
    order = np.lexsort((recording.frame, recording.track))
    step = max(1, round(TURN_OVER_S * recording.frame_rate))
    track, frame = recording.track[order], recording.frame[order]
    first = np.arange(0, max(0, len(order) - step), step)
    last = first + step
    position, velocity = recording.position[order], recording.velocity[order]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    same = (track[first] == track[last]) & (frame[last] - frame[first] == step)
    kept = first[same & _moving(speed, first) & _moving(speed, last)]
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    turn = wrap(course[kept + step] - course[kept])
    moved = np.linalg.norm(position[kept + step] - position[kept], axis=1)
    middle = kept + step // 2
    direction = np.stack([np.cos(course[middle]), np.sin(course[middle])], axis=1)
    return position[middle], direction, turn / np.maximum(moved, 1e-3)


def _moving(speed: Float64Array, rows: np.ndarray) -> BoolArray:
    with np.errstate(invalid="ignore"):
        return np.asarray(speed[rows] > LEAST_MPS)
