# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether lane lines fit the traffic: near it, and around the vehicles that move."""

from __future__ import annotations

import numpy as np

from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import AgentClass, ClassArray, Float64Array

FAR_M = 1000.0
"""Lane lines farther than this from all road users are of another place (m); chosen: no tracker
sees farther."""

_CHECKED = 64
"""Road users that are looked at, at most; chosen: the cost stays below a millisecond or two."""

_MOVING_MPS = 2.0
"""Slower vehicles may be parked beside the road (m/s); chosen."""

_FORGET = 0.98
"""Share of the counts that is kept from one look to the next: fifty looks count; chosen."""

_ENOUGH = 15.0
"""Moving vehicles, counted once for each look, from which on a verdict is given; chosen."""

_LEAST_SHARE = 0.02
"""Share of them within lanes below which the lines are mistaken; chosen: vehicles off the mapped
roads alone leave more."""

_NO_VEHICLES = (AgentClass.PEDESTRIAN, AgentClass.ANIMAL)


class LaneFit:
    """Compares lane lines with the observed traffic; to be given one observation a second."""

    def __init__(self) -> None:
        self._distance_m = 0.0
        self._moving = self._within = 0.0

    def look(
        self,
        lanes: LaneMap,
        position: Float64Array,
        velocity: Float64Array,
        agent_class: ClassArray,
    ) -> None:
        """Compare the lines with the road users of an instant.

        Args:
            lanes: the lines.
            position: [n, 2] in the frame of the lines (m).
            velocity: [n, 2] (m/s), NaN where unknown.
            agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        """
        if not len(lanes) or not len(position):
            return
        position, velocity = position[:_CHECKED], np.nan_to_num(velocity[:_CHECKED])
        self._distance_m = lanes.distance_m(position)
        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > _MOVING_MPS
        moving &= ~np.isin(agent_class[:_CHECKED], _NO_VEHICLES)
        course = np.arctan2(velocity[moving, 1], velocity[moving, 0])
        within = np.isfinite(lanes.positions(position[moving], course)[:, 0])
        self._moving = _FORGET * self._moving + len(within)
        self._within = _FORGET * self._within + int(within.sum())

    @property
    def problem(self) -> str:
        """What is wrong, empty if nothing is."""
        if self._distance_m > FAR_M:
            return (
                f"no lane line within {FAR_M * 1e-3:g} km of the road users, the nearest is"
                f" {self._distance_m * 1e-3:.0f} km away"
            )
        if self._moving >= _ENOUGH and self._within < _LEAST_SHARE * self._moving:
            return "no vehicle that moves is in a lane"
        return ""

    @property
    def values(self) -> dict[str, str]:
        """Values for the diagnostics."""
        share = f"{self._within / self._moving:.2f}" if self._moving else ""
        return {"lane_distance_m": f"{self._distance_m:.0f}", "in_lane": share}
