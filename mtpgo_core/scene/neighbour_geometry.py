# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where everybody is as seen by each agent: the geometry of the map-free road contexts.

At every history step an agent looks along its own yaw at that step; nothing of another step and
no scene frame enters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float32Array, Float64Array, HistoryWindow

NEAR_M = 20.0
"""Distance over which nearness falls to 1/e."""

_BLOCK = 1 << 20
"""Pairs times steps that are worked on at a time, which bounds the memory for large scenes."""


@dataclass(frozen=True)
class NeighbourGeometry:
    """All others around r agents at T steps, out of n in the window.

    Who is where is decided in float32, which is true to a tenth of a millimetre within a kilometre
    and takes half the time; values are taken from the window itself.

    Attributes:
        window: the history.
        agents: [r] positions in the window.
        cos: [r, T] of the agents' yaw, 1 where it was never known.
        sin: [r, T] likewise.
        along: [r, T, n] how far ahead the other's centre is (m), NaN where either is absent.
        across: [r, T, n] how far to the left (m).
    """

    window: HistoryWindow
    agents: NDArray[np.intp]
    cos: Float64Array
    sin: Float64Array
    along: Float32Array
    across: Float32Array

    @classmethod
    def of(cls, window: HistoryWindow, agents: NDArray[np.intp]) -> NeighbourGeometry:
        """Of the agents at the positions ``agents`` [r] of the window."""
        yaw = np.nan_to_num(window.yaw[agents])
        cos, sin = np.cos(yaw), np.sin(yaw)
        # Less a point in their midst before the digits are halved.
        seen = window.position[window.valid]
        near = window.position - (seen.mean(axis=0) if len(seen) else 0.0)
        place = np.ascontiguousarray(near.transpose(2, 1, 0), np.float32)  # [2, T, n]
        x, y = (of_all - of_all[:, agents].T[..., None] for of_all in place)  # [r, T, n]
        c, s = (value.astype(np.float32)[..., None] for value in (cos, sin))
        return cls(window, agents, cos, sin, along=c * x + s * y, across=c * y - s * x)

    def nearest(
        self, there: BoolArray, distance: Float32Array
    ) -> tuple[NDArray[np.intp], BoolArray]:
        """[r, T] who of those ``there`` has the least ``distance``, and whether there is one.

        Args:
            there: [r, T, n] who counts.
            distance: [r, T, n] (m).
        """
        who = np.where(there, distance, np.float32(np.inf)).argmin(axis=2)
        return who, np.take_along_axis(there, who[..., None], axis=2)[..., 0]

    def offset(self, who: NDArray[np.intp]) -> tuple[Float64Array, Float64Array]:
        """[r, T] how far ahead and how far to the left ``who`` [r, T] is (m)."""
        offset = self._of(self.window.position, who) - self.window.position[self.agents]
        return self._ahead(offset), self.cos * offset[..., 1] - self.sin * offset[..., 0]

    def faster(self, who: NDArray[np.intp]) -> Float64Array:
        """[r, T] velocity of ``who`` [r, T] less the agent's own, along its yaw (m/s)."""
        velocity = self.window.velocity
        return self._ahead(self._of(velocity, who) - velocity[self.agents])

    def acceleration(self, who: NDArray[np.intp]) -> Float64Array:
        """[r, T] acceleration of ``who`` [r, T] along the agent's yaw (m/s^2)."""
        return self._ahead(self._of(self.window.acceleration, who))

    def _of(self, values: Float64Array, who: NDArray[np.intp]) -> Float64Array:
        of_who: Float64Array = values[who, np.arange(who.shape[1])]
        return of_who

    def _ahead(self, vectors: Float64Array) -> Float64Array:
        """[r, T] part of vectors [r, T, 2] of the window's frame along the agents' yaws."""
        return self.cos * vectors[..., 0] + self.sin * vectors[..., 1]


def nearness(gap: Float64Array, there: BoolArray) -> Float64Array:
    """exp(-gap / ``NEAR_M``) of gaps (m), 0 where nobody is."""
    return np.where(there, np.exp(-np.where(there, gap, 0.0) / NEAR_M), 0.0)


def in_blocks(
    columns: Callable[[NeighbourGeometry], Float64Array],
    count: int,
    window: HistoryWindow,
    agents: NDArray[np.intp],
) -> Float64Array:
    """[r, T, count] of ``columns``, a few agents at a time.

    Args:
        columns: [r, T, count] of the surroundings of r agents.
        count: of the columns.
        window: the history.
        agents: [r] positions in the window.
    """
    steps = window.valid.shape[1]
    out = np.empty((len(agents), steps, count))
    rows = max(1, _BLOCK // max(1, len(window) * steps))
    with np.errstate(invalid="ignore"):  # NaN where somebody is absent compares as not there
        for start in range(0, len(agents), rows):
            some = slice(start, start + rows)
            out[some] = columns(NeighbourGeometry.of(window, agents[some]))
    return out
