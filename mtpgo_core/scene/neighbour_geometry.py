# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of all agents relative to each agent: the geometry of the road contexts without map.

At every history step, positions are relative to the agent's position and yaw at that step. Neither
other steps nor the scene frame matter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import BoolArray, Float32Array, Float64Array, HistoryWindow, IndexArray

NEAR_M = 20.0
"""Distance over which :func:`nearness` falls to 1/e (m); chosen."""

_BLOCK = 1 << 20
"""Most pairs times steps per block, which limits the memory for large scenes; chosen."""

_TOGETHER = 64
"""Agents whose surroundings are looked up together in a scene that needs several blocks; of 16 to
256, the fastest for 5000 agents (measured)."""

_MARGIN_M = 0.1
"""Margin of the surroundings for the rounding of float32 positions (m): 4 mm at 65 km from the
middle."""


@dataclass(frozen=True)
class NeighbourGeometry:
    """The n agents of a window relative to r of them, at T steps.

    ``along`` and ``across``, which only select agents, are float32: accurate to 0.1 mm within a
    kilometre, in half the time. Feature values are computed from the window in float64.

    Attributes:
        window: the history.
        agents: [r] positions in the window.
        cos: [r, T] of the agents' yaw, 1 where it was never known.
        sin: [r, T] of the agents' yaw, 0 where it was never known.
        along: [r, T, n] distance ahead of the other agent's centre (m), NaN where either is
            absent.
        across: [r, T, n] its distance to the left (m), NaN where either is absent.
    """

    window: HistoryWindow
    agents: IndexArray
    cos: Float64Array
    sin: Float64Array
    along: Float32Array
    across: Float32Array

    @classmethod
    def of(
        cls, window: HistoryWindow, agents: IndexArray, place: Float32Array | None = None
    ) -> NeighbourGeometry:
        """Return the geometry around the agents at the positions ``agents`` [r] of the window.

        Args:
            window: the history.
            agents: [r] positions in the window.
            place: :func:`places` of the window, computed if not given.
        """
        yaw = np.nan_to_num(window.yaw[agents])
        cos, sin = np.cos(yaw), np.sin(yaw)
        place = places(window) if place is None else place
        x, y = (of_all - of_all[:, agents].T[..., None] for of_all in place)  # [r, T, n]
        c, s = (value.astype(np.float32)[..., None] for value in (cos, sin))
        return cls(window, agents, cos, sin, along=c * x + s * y, across=c * y - s * x)

    def nearest(
        self, candidate: BoolArray, distance: Float32Array
    ) -> tuple[IndexArray, BoolArray]:
        """Return [r, T] the candidate at the least ``distance``, and whether there is one.

        Args:
            candidate: [r, T, n] which agents are considered.
            distance: [r, T, n] (m).
        """
        who = np.where(candidate, distance, np.float32(np.inf)).argmin(axis=2)
        return who, np.take_along_axis(candidate, who[..., None], axis=2)[..., 0]

    def offset(self, who: IndexArray) -> tuple[Float64Array, Float64Array]:
        """Return [r, T] the distances ahead and to the left of the agents ``who`` [r, T] (m)."""
        offset = self._of(self.window.position, who) - self.window.position[self.agents]
        return self._ahead(offset), self.cos * offset[..., 1] - self.sin * offset[..., 0]

    def relative_speed(self, who: IndexArray) -> Float64Array:
        """Return [r, T] the velocity of ``who`` [r, T] minus the agent's, along its yaw (m/s)."""
        velocity = self.window.velocity
        return self._ahead(self._of(velocity, who) - velocity[self.agents])

    def acceleration(self, who: IndexArray) -> Float64Array:
        """Return [r, T] the acceleration of ``who`` [r, T] along the agent's yaw (m/s^2)."""
        return self._ahead(self._of(self.window.acceleration, who))

    def _of(self, values: Float64Array, who: IndexArray) -> Float64Array:
        of_who: Float64Array = values[who, np.arange(who.shape[1])]
        return of_who

    def _ahead(self, vectors: Float64Array) -> Float64Array:
        """Return [r, T] the component of vectors [r, T, 2] along the agents' yaws."""
        return self.cos * vectors[..., 0] + self.sin * vectors[..., 1]


def places(window: HistoryWindow) -> Float32Array:
    """Return [2, T, n] positions relative to their median (m), precise enough in float32.

    The mean would be moved by a single stray object far away, and all others with it.
    """
    seen = window.position[window.valid]
    near = window.position - (np.median(seen, axis=0) if len(seen) else 0.0)
    return np.ascontiguousarray(near.transpose(2, 1, 0), np.float32)


def nearness(gap: Float64Array, there: BoolArray) -> Float64Array:
    """Return exp(-gap / ``NEAR_M``) of gaps (m), 0 where no agent is there."""
    return np.where(there, np.exp(-np.where(there, gap, 0.0) / NEAR_M), 0.0)


def in_blocks(
    columns: Callable[[NeighbourGeometry], Float64Array],
    count: int,
    window: HistoryWindow,
    agents: IndexArray,
    within_m: float,
) -> Float64Array:
    """Return [r, T, count] features, computed block by block.

    Args:
        columns: returns [r, T, count] features for the geometry around r agents. They must not
            depend on agents that are farther than ``within_m`` from the agent at that step.
        count: number of features.
        window: the history.
        agents: [r] positions in the window.
        within_m: distance up to which others matter (m).
    """
    steps = window.valid.shape[1]
    out = np.empty((len(agents), steps, count))
    if len(agents) == 0:
        return out
    place = places(window)
    with np.errstate(invalid="ignore"):  # NaN of an absent agent compares as false
        if len(agents) * len(window) * steps <= _BLOCK:
            out[:] = columns(NeighbourGeometry.of(window, agents, place))
            return out
        for group in _groups_of_neighbours(place[:, -1, agents], within_m):
            near = _surroundings(place, agents[group], within_m + _MARGIN_M)
            around, here = window.select(near), np.ascontiguousarray(place[:, :, near])
            own = np.searchsorted(near, agents[group])
            rows = max(1, _BLOCK // (len(near) * steps))
            for start in range(0, len(group), rows):
                some = slice(start, start + rows)
                out[group[some]] = columns(NeighbourGeometry.of(around, own[some], here))
    return out


def _groups_of_neighbours(place: Float32Array, cell_m: float) -> list[IndexArray]:
    """Return groups of at most ``_TOGETHER`` agents near each other, by positions [2, r] (m)."""
    order = np.lexsort((*place, *np.floor(place / np.float32(cell_m))))
    return [order[k : k + _TOGETHER] for k in range(0, len(order), _TOGETHER)]


def _surroundings(place: Float32Array, agents: IndexArray, within_m: float) -> IndexArray:
    """Return ``agents`` and all agents near them at any step, ascending.

    Near means within the bounding box of ``agents`` at that step, widened by ``within_m``.

    Args:
        place: [2, T, n] positions (m), NaN where absent.
        agents: [r] positions among the n agents.
        within_m: widening of the bounding box on each side (m).
    """
    own = place[:, :, agents]
    here = np.isfinite(own)
    low = np.where(here, own, np.inf).min(axis=2, keepdims=True) - np.float32(within_m)
    high = np.where(here, own, -np.inf).max(axis=2, keepdims=True) + np.float32(within_m)
    inside = ((place >= low) & (place <= high)).all(axis=0).any(axis=0)
    inside[agents] = True
    return np.flatnonzero(inside)
