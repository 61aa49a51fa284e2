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

from mtpgo_core.schema import Float64Array, HistoryWindow

NEAR_M = 20.0
"""Distance over which nearness falls to 1/e."""

_BLOCK = 1 << 20
"""Pairs times steps that are worked on at a time, which bounds the memory for large scenes."""


@dataclass(frozen=True)
class Surroundings:
    """All others around r agents at T steps, out of n in the window.

    Attributes:
        window: the history.
        agents: [r] positions in the window.
        cos: [r, T] of the agents' yaw, 1 where it was never known.
        sin: [r, T] likewise.
        along: [r, n, T] how far ahead the other's centre is (m), NaN where either is absent.
        across: [r, n, T] how far to the left (m).
    """

    window: HistoryWindow
    agents: NDArray[np.intp]
    cos: Float64Array
    sin: Float64Array
    along: Float64Array
    across: Float64Array

    @classmethod
    def of(cls, window: HistoryWindow, agents: NDArray[np.intp]) -> Surroundings:
        """Of the agents at the positions ``agents`` [r] of the window."""
        yaw = np.nan_to_num(window.yaw[agents])
        cos, sin = np.cos(yaw), np.sin(yaw)
        offset = window.position[None] - window.position[agents][:, None]  # [r, n, T, 2]
        return cls(
            window=window,
            agents=agents,
            cos=cos,
            sin=sin,
            along=cos[:, None] * offset[..., 0] + sin[:, None] * offset[..., 1],
            across=cos[:, None] * offset[..., 1] - sin[:, None] * offset[..., 0],
        )

    def nearest(self, distance: Float64Array) -> tuple[NDArray[np.intp], Float64Array]:
        """[r, T] the other with the least ``distance`` [r, n, T] (m), and that distance.

        Infinity stands for those that do not count, and comes back where nobody does.
        """
        who = distance.argmin(axis=1)
        return who, np.take_along_axis(distance, who[:, None], axis=1)[:, 0]

    def ahead_component(self, vectors: Float64Array) -> Float64Array:
        """[r, T] part of vectors [r, T, 2] of the window's frame along the agents' yaws."""
        return self.cos * vectors[..., 0] + self.sin * vectors[..., 1]

    def faster(self, who: NDArray[np.intp]) -> Float64Array:
        """[r, T] velocity of ``who`` [r, T] less the agent's own, along its yaw (m/s)."""
        velocity = self.window.velocity
        step = np.arange(who.shape[1])
        return self.ahead_component(velocity[who, step] - velocity[self.agents])

    def acceleration(self, who: NDArray[np.intp]) -> Float64Array:
        """[r, T] acceleration of ``who`` [r, T] along the agent's yaw (m/s^2)."""
        return self.ahead_component(self.window.acceleration[who, np.arange(who.shape[1])])


def nearness(gap: Float64Array, there: NDArray[np.bool_]) -> Float64Array:
    """exp(-gap / ``NEAR_M``) of gaps (m), 0 where nobody is."""
    return np.where(there, np.exp(-np.where(there, gap, 0.0) / NEAR_M), 0.0)


def in_blocks(
    columns: Callable[[Surroundings], Float64Array],
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
            out[some] = columns(Surroundings.of(window, agents[some]))
    return out
