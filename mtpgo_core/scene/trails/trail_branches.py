# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Distinct continuations: the paths of earlier road users, those alike taken together."""

from __future__ import annotations

import numpy as np

from mtpgo_core.scene.trails.trail_paths import TrailPaths
from mtpgo_core.schema import BoolArray, Float64Array

BRANCHES = 3
"""Continuations of an agent; chosen: left, straight on and right."""
_ALIKE_M, _ALIKE_SHARE = 1.0, 0.06
"""Two paths are alike where they are no farther apart than this (m), plus this share of the
distance ahead; chosen: drivers use the width of a lane, ramps leave at 5 degrees and more."""
_COMPARED = 6
"""Distances ahead at which two paths are compared; chosen, bounds the time."""


def branches(
    paths: TrailPaths, distance: Float64Array
) -> tuple[Float64Array, BoolArray, Float64Array]:
    """Return the distinct continuations of each agent, the likeliest first.

    The path that most of the weight is alike represents a branch. The weight of all that are alike
    is the branch's, they are taken away, and the rest is searched for the next branch.

    Args:
        paths: of the trails that pass n agents.
        distance: [n, H] distances ahead (m).

    Returns:
        [n, R, H, 2] paths (m), [n, R, H] whether they are known, [n, R] shares of the weight.
    """
    n, _, horizon = paths.known.shape
    path = np.zeros((n, BRANCHES, horizon, 2))
    known = np.zeros((n, BRANCHES, horizon), dtype=bool)
    share = np.zeros((n, BRANCHES))
    alike = _alike(paths, distance)
    reach = paths.known.sum(axis=-1) / horizon
    left = paths.weight.copy()
    total = np.maximum(left.sum(axis=1), np.finfo(np.float64).tiny)
    rows = np.arange(n)
    for branch in range(BRANCHES):
        support = (alike * left[:, None]).sum(axis=-1)
        best = np.argmax(np.where(left > 0.0, support * reach, -1.0), axis=1)
        there = left[rows, best] > 0.0
        mine = alike[rows, best] & there[:, None]
        path[:, branch] = _mean(paths, np.where(mine, left, 0.0))
        known[:, branch] = paths.known[rows, best] & there[:, None]
        share[:, branch] = support[rows, best] / total * there
        left = np.where(mine, 0.0, left)
    path[~known] = 0.0
    return path, known, share


def _mean(paths: TrailPaths, weight: Float64Array) -> Float64Array:
    """Return [n, H, 2] weighted mean of the paths where they are known."""
    of = (weight[..., None] * paths.known).astype(np.float64)
    total = of.sum(axis=1)
    mean = np.einsum("nch,nchx->nhx", of, paths.path)
    of_known: Float64Array = mean / np.maximum(total, np.finfo(np.float64).tiny)[..., None]
    return of_known


def _alike(paths: TrailPaths, distance: Float64Array) -> BoolArray:
    """Return [n, C, C] whether two paths are alike as far as both are known."""
    horizon = distance.shape[1]
    steps = np.unique(np.linspace(0, horizon - 1, min(horizon, _COMPARED)).round().astype(int))
    path, known = paths.path[:, :, steps], paths.known[:, :, steps]
    limit = _ALIKE_M + _ALIKE_SHARE * distance[:, steps]
    apart = path[:, :, None] - path[:, None]
    far = (apart**2).sum(axis=-1) > (limit**2)[:, None, None]
    far &= known[:, :, None] & known[:, None]
    there = paths.weight > 0.0
    return ~far.any(axis=-1) & there[:, :, None] & there[:, None]
