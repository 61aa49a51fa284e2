# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Distinct continuations: the paths of earlier road users, those alike taken together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.scene.trails.trail_paths import TrailPaths
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import Float32Array, Float64Array

BRANCHES = 3
"""Continuations of an agent; chosen: left, straight on and right."""
_ALIKE_M, _ALIKE_SHARE = 1.0, 0.06
"""Two paths are alike where they are no farther apart than this (m), plus this share of the
distance ahead; chosen: drivers use the width of a lane, ramps leave at 5 degrees and more."""
_COMPARED = 6
"""Distances ahead at which two paths are compared; chosen, bounds the time."""
TINY = np.float32(1e-30)
"""Least divisor; all weights are larger or zero."""


@dataclass(frozen=True)
class Branches:
    """Up to R distinct continuations of n agents, the one with the largest share first.

    Attributes:
        ahead: [n, R, H] place in the agent's frame (m), 0 where not known, as ``left``.
        left: [n, R, H] (m).
        reach: [n, R] horizon steps up to which it is known, 0 where there is none.
        share: [n, R] of the weight of all trails that pass the agent.
    """

    ahead: Float32Array
    left: Float32Array
    reach: IntArray
    share: Float32Array


def branches(paths: TrailPaths, distance: Float64Array) -> Branches:
    """Return the distinct continuations of each agent.

    The path that most of the weight is alike represents a branch. All paths alike give the
    branch its share and, where they are known, its mean; they are taken away, and the rest is
    searched for the next branch.

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
        there = rest[rows, best] > 0.0
        if not there.any():
            break
        mine = rest * alike[rows, best] * there[:, None]
        share[:, branch] = mine.sum(axis=1) / total
        reach[:, branch] = paths.reach[rows, best] * there
        of = known * mine
        weight = np.maximum(of.sum(axis=-1), TINY)
        seen = (np.arange(horizon) < reach[:, branch, None]).astype(np.float32)
        ahead[:, branch] = ((of * paths.ahead).sum(axis=-1) / weight).T * seen
        left[:, branch] = ((of * paths.left).sum(axis=-1) / weight).T * seen
        rest = np.where(mine > 0.0, np.float32(0.0), rest)
    return Branches(ahead, left, reach, share)


def alike_limit_m(distance: Float64Array) -> Float64Array:
    """Return how far apart two paths that are alike may be at distances ahead (m)."""
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
