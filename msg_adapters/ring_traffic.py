# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Generated traffic of any size, the fixture of the node's load generator and the benchmarks.

Vehicles drive on a ring road of six lanes, three in each direction, at about the density of a busy
motorway: more vehicles make a longer road, not a denser one. So the traffic has the same
properties over any time, no vehicle leaves or jumps, and neighbours change all the time.

The load generator (mtpgo_ros) and the growth benchmark (mtpgo_training) must measure the same
traffic and cannot import each other, so it is kept below both.
"""

from __future__ import annotations

import math

import numpy as np

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, TrackedStates, tracked_states

_LANES = 6

_LANE_WIDTH_M = 3.5
"""Width of a lane (m); chosen: common on European roads."""

_SPACING_M = 30.0
"""Distance of two vehicles on a lane, front to front (m); chosen: busy traffic."""

_SHORTEST_M = 240.0
"""Shortest road (m); chosen, so that few vehicles do not turn in a small circle."""

_SLOWEST_MPS, _FASTEST_MPS = 14.0, 22.0
"""Speeds of the slowest and the fastest lane (m/s); chosen, so that lanes overtake each other."""


class RingTraffic:
    """A number of vehicles on a ring road.

    Args:
        agents: number of vehicles.
    """

    def __init__(self, agents: int) -> None:
        row = np.arange(agents)
        lane = row % _LANES
        length_m = max(_SHORTEST_M, _SPACING_M * math.ceil(agents / _LANES))
        # Inner lanes and outer lanes run in opposite directions, at a speed for each lane.
        direction = np.where(lane < _LANES // 2, 1.0, -1.0)
        speed = np.linspace(_SLOWEST_MPS, _FASTEST_MPS, _LANES)[lane]
        radius_m = length_m / (2.0 * math.pi)
        self._radius_m = radius_m + _LANE_WIDTH_M * (lane - (_LANES - 1) / 2.0)
        self._turn_radps = direction * speed / self._radius_m
        self._start = 2.0 * math.pi * (row // _LANES) / math.ceil(agents / _LANES) + 0.3 * lane
        self._key = keys_from_integers(range(1, agents + 1))
        self._class = np.full(agents, AgentClass.CAR, dtype=np.uint8)
        self._size = np.tile([4.6, 1.9], (agents, 1))

    def at(self, time_s: float, stamp_ns: int) -> TrackedStates:
        """Return the vehicles at a time (s) after the start, with a stamp (ns)."""
        angle = self._start + self._turn_radps * time_s
        outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        along = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
        velocity = (self._turn_radps * self._radius_m)[:, None] * along
        return tracked_states(
            stamp_ns,
            "map",
            self._key,
            self._radius_m[:, None] * outward,
            agent_class=self._class,
            z=np.zeros(len(self._key)),
            velocity=velocity,
            yaw=np.arctan2(velocity[:, 1], velocity[:, 0]),
            size=self._size,
        )
