# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Road users whose predicted boxes overlap although their true ones do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality.metrics import Array, Mask
from mtpgo_core.schema import BoolArray, IndexArray

HEADING_M = 0.05
"""A step gives a new heading if it is at least this long (m); chosen above rounding."""


def path_headings(path: Array, start: Array, yaw: Array) -> Array:
    """[n, H, 2] unit vectors of the heading along a path.

    Args:
        path: [n, H, 2] (m).
        start: [n, 2] position before the first step (m).
        yaw: [n] heading kept until the first step of at least :data:`HEADING_M` (rad).
    """
    moves = np.diff(np.concatenate([start[:, None], path], axis=1), axis=1)
    length = np.linalg.norm(moves, axis=-1)
    long = length >= HEADING_M
    steps = np.where(long, np.arange(1, path.shape[1] + 1), 0)
    last = np.maximum.accumulate(steps, axis=1)
    unit = moves / np.where(long, length, 1.0)[..., None]
    first = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)[:, None]
    return np.take_along_axis(np.concatenate([first, unit], axis=1), last[..., None], axis=1)


def pairs_within(instant: NDArray[np.int64]) -> tuple[IndexArray, IndexArray]:
    """Return both rows of every pair of agents of the same instant [n]; rows are sorted by it."""
    starts = np.flatnonzero(np.diff(instant, prepend=instant[:1] - 1))
    ends = np.append(starts[1:], len(instant))[: len(starts)]
    found = [
        np.stack(np.triu_indices(end - start, 1)) + start
        for start, end in zip(starts, ends, strict=True)
    ]
    first, second = np.concatenate([np.empty((2, 0), np.intp), *found], axis=1)
    return first, second


def boxes_overlap(
    position: tuple[Array, Array], heading: tuple[Array, Array], size: tuple[Array, Array]
) -> BoolArray:
    """[k] whether the boxes of each pair overlap: no axis of either separates them.

    Args:
        position: centres [k, 2] of both (m).
        heading: unit vectors [k, 2] of both.
        size: lengths and widths [k, 2] of both (m).
    """
    between = position[1] - position[0]
    overlap = np.ones(len(between), dtype=bool)
    sides = [np.stack([h[:, 1], -h[:, 0]], axis=-1) for h in heading]
    for axis in (*heading, *sides):
        reach = np.zeros(len(between))
        for along, across, extent in zip(heading, sides, size, strict=True):
            reach += 0.5 * extent[:, 0] * np.abs((along * axis).sum(axis=-1))
            reach += 0.5 * extent[:, 1] * np.abs((across * axis).sum(axis=-1))
        overlap &= np.abs((between * axis).sum(axis=-1)) < reach
    return overlap


def new_overlaps(
    path: Array,
    truth: Array,
    mask: Mask,
    start: Array,
    yaw: Array,
    size: Array,
    pairs: tuple[IndexArray, IndexArray],
) -> BoolArray:
    """[n] whether an agent's predicted box overlaps another's, while their true boxes never do.

    Only steps at which both were observed are looked at, so predictions beyond the end of the
    recording do not count against any agent.

    Args:
        path: [n, H, 2] the heaviest modes (m).
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
        start: [n, 2] position at the time of the prediction (m).
        yaw: [n] heading then (rad).
        size: [n, 2] length, width (m).
        pairs: rows of the pairs, see :func:`pairs_within`.
    """
    n, found = len(path), np.zeros(len(path), dtype=bool)
    reach = 0.5 * np.linalg.norm(size, axis=1)
    one, two = pairs
    # No farther apart than both move plus both reach: the others can never touch.
    far = np.linalg.norm(path - start[:, None], axis=-1).max(axis=1, initial=0.0) + reach
    near = np.linalg.norm(start[one] - start[two], axis=-1) < far[one] + far[two]
    one, two = one[near], two[near]
    hit = _overlap_steps(path, mask, path_headings(path, start, yaw), size, reach, one, two)
    some = hit.any(axis=1)
    one, two = one[some], two[some]
    if not len(one):
        return found
    both = np.unique(np.concatenate([one, two]))
    place = np.zeros(n, dtype=np.intp)
    place[both] = np.arange(len(both))
    real = np.where(mask[both][..., None], truth[both], start[both][:, None])
    headings = path_headings(real, start[both], yaw[both])
    true = _overlap_steps(
        real, mask[both], headings, size[both], reach[both], place[one], place[two]
    )
    new = ~true.any(axis=1)
    found[one[new]] = True
    found[two[new]] = True
    return found


def _overlap_steps(
    path: Array,
    mask: Mask,
    heading: Array,
    size: Array,
    reach: Array,
    one: IndexArray,
    two: IndexArray,
) -> BoolArray:
    """[pairs, H] the steps at which both of a pair were observed and their boxes overlap."""
    distance = np.linalg.norm(path[one] - path[two], axis=-1)
    close = (distance < (reach[one] + reach[two])[:, None]) & mask[one] & mask[two]
    pair, step = np.nonzero(close)
    a, b = one[pair], two[pair]
    close[pair, step] = boxes_overlap(
        (path[a, step], path[b, step]),
        (heading[a, step], heading[b, step]),
        (size[a], size[b]),
    )
    return close
