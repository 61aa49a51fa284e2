# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Branches: the paths of earlier road users, with similar paths merged into one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.scene.trails.trail_paths import TrailPaths
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import Float32Array, Float64Array

BRANCHES = 3
"""Continuations of an agent; chosen: left, straight on and right."""
_ALIKE_M, _ALIKE_SHARE = 1.0, 0.06
"""Two paths are alike if their distance is at most this (m) plus this share of the distance ahead;
chosen: drivers use the width of a lane, ramps leave at 5 degrees and more."""
_COMPARED = 6
"""Distances ahead at which two paths are compared; chosen, bounds the time."""
TINY = np.float32(1e-30)
"""Least divisor; all weights are larger or zero."""


@dataclass(frozen=True)
class Branches:
    """Up to R distinct continuations of n agents, the one with the largest share first.

    Attributes:
        ahead: [n, R, H] x in the agent's frame (m), 0 where unknown.
        left: [n, R, H] y in the agent's frame (m), 0 where unknown.
        reach: [n, R] horizon steps up to which it is known, 0 where there is none.
        share: [n, R] of the weight of all trails that pass the agent.
    """

    ahead: Float32Array
    left: Float32Array
    reach: IntArray
    share: Float32Array


def branches(paths: TrailPaths, distance: Float64Array) -> Branches:
    """Return the distinct continuations of each agent by greedy clustering.

    The path that is alike to paths with the largest total weight (times its known length) becomes
    the representative of a branch. The paths alike to it give the branch its share and its
    weighted mean; they are removed, and the next branch is sought among the rest.

    Args:
        paths: of the trails that pass n agents.
        distance: [n, H] distances ahead (m).
    """
    horizon, n, _ = paths.ahead.shape
    ahead, left = np.zeros((2, n, BRANCHES, horizon), dtype=np.float32)
    reach = np.zeros((n, BRANCHES), dtype=np.int64)
    share = np.zeros((n, BRANCHES), dtype=np.float32)
    alike = _alike(paths, distance)
    known = (np.arange(horizon)[:, None, None] < paths.reach).astype(np.float32)
    rest = paths.weight.copy()
    total = np.maximum(rest.sum(axis=1), TINY)
    rows = np.arange(n)
    for branch in range(BRANCHES):
        support = (alike @ rest[..., None])[..., 0]
        best = np.argmax(np.where(rest > 0.0, support * (1.0 + paths.reach), -1.0), axis=1)
        exists = rest[rows, best] > 0.0
        if not exists.any():
            break
        merged = rest * alike[rows, best] * exists[:, None]  # [n, C] weights of the branch's paths
        share[:, branch] = merged.sum(axis=1) / total
        reach[:, branch] = paths.reach[rows, best] * exists
        weight = known * merged  # [H, n, C]
        weight_sum = np.maximum(weight.sum(axis=-1), TINY)
        reached = (np.arange(horizon) < reach[:, branch, None]).astype(np.float32)
        ahead[:, branch] = ((weight * paths.ahead).sum(axis=-1) / weight_sum).T * reached
        left[:, branch] = ((weight * paths.left).sum(axis=-1) / weight_sum).T * reached
        rest = np.where(merged > 0.0, np.float32(0.0), rest)
    return Branches(ahead, left, reach, share)


def alike_limit_m(distance: Float64Array) -> Float64Array:
    """Return the largest distance between two paths that are alike, by the distance ahead (m)."""
    return _ALIKE_M + _ALIKE_SHARE * distance


def _alike(paths: TrailPaths, distance: Float64Array) -> Float32Array:
    """Return [n, C, C] 1 where two paths are alike as far as both are known, else 0."""
    there = paths.weight > 0.0
    alike = there[:, :, None] & there[:, None]
    horizon = distance.shape[1]
    for step in np.unique(np.linspace(0, horizon - 1, _COMPARED).round().astype(int)).tolist():
        x, y = paths.ahead[step], paths.left[step]
        limit = alike_limit_m(distance[:, step, None, None]).astype(np.float32)
        apart = (x[:, :, None] - x[:, None]) ** 2 + (y[:, :, None] - y[:, None]) ** 2
        unknown = paths.reach <= step
        alike &= (apart <= limit**2) | unknown[:, :, None] | unknown[:, None]
    return alike.astype(np.float32)
