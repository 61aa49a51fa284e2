# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Social force model of pedestrians (Helbing and Molnar 1995), with groups and stops.

Each pedestrian accelerates towards a desired velocity and is repelled by others, more by those in
front, and by walls. SUMO's own models move pedestrians along lanes, which a crowd on an open place
does not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import BoolArray, Float64Array


@dataclass(frozen=True)
class SocialForceConfig:
    """Parameters of the model; chosen within the range of published fits.

    Attributes:
        relaxation_s: time in which the desired velocity is approached (s).
        repulsion_mps2: acceleration away from another at touching distance (m/s^2).
        repulsion_m: distance over which it falls by a factor e (m).
        behind: share of the repulsion by someone straight behind.
        horizon_s: relative motion over this time counts as distance, so that pedestrians evade
            early (s).
        cohesion_mps2: largest acceleration towards the middle of the own group (m/s^2).
        wall_mps2: acceleration away from a wall at touching distance (m/s^2).
        wall_m: distance over which it falls by a factor e (m).
        largest_mps2: limit of the acceleration (m/s^2).
        radius_m: half the shoulder width (m).
    """

    relaxation_s: float = 0.6
    repulsion_mps2: float = 2.5
    repulsion_m: float = 0.45
    behind: float = 0.2
    horizon_s: float = 0.6
    cohesion_mps2: float = 0.8
    wall_mps2: float = 3.0
    wall_m: float = 0.3
    largest_mps2: float = 3.5
    radius_m: float = 0.25


@dataclass
class Crowd:
    """State of all pedestrians, one row each.

    Attributes:
        position: [n, 2] (m).
        velocity: [n, 2] (m/s).
        desired: [n, 2] desired velocity (m/s), set before each step.
        group: [n] number of the group, equal for those who walk together.
        present: [n] whether the pedestrian is there.
    """

    position: Float64Array
    velocity: Float64Array
    desired: Float64Array
    group: np.ndarray
    present: BoolArray

    def step(self, dt: float, config: SocialForceConfig, half_width_m: float) -> None:
        """Move all present pedestrians by a time step.

        Args:
            dt: time step (s).
            config: the model.
            half_width_m: distance of the walls at y = +-half_width_m (m), infinite without walls.
        """
        rows = np.flatnonzero(self.present)
        if not len(rows):
            return
        position, velocity = self.position[rows], self.velocity[rows]
        force = (self.desired[rows] - velocity) / config.relaxation_s
        force += repulsion(position, velocity, self.group[rows], config)
        force += self._cohesion(rows, config)
        if np.isfinite(half_width_m):
            for side in (-1.0, 1.0):
                gap = half_width_m - side * position[:, 1] - config.radius_m
                force[:, 1] -= side * config.wall_mps2 * np.exp(-gap / config.wall_m)
        size = np.linalg.norm(force, axis=1, keepdims=True)
        force *= np.minimum(1.0, config.largest_mps2 / np.maximum(size, 1e-9))
        self.velocity[rows] = velocity + dt * force
        self.position[rows] = position + dt * self.velocity[rows]

    def _cohesion(self, rows: np.ndarray, config: SocialForceConfig) -> Float64Array:
        """Return the [rows, 2] accelerations towards the middles of the groups (m/s^2)."""
        _, group = np.unique(self.group[rows], return_inverse=True)
        count = np.bincount(group)
        middle = np.stack([np.bincount(group, x) for x in self.position[rows].T], axis=1)
        towards = middle[group] / count[group, None] - self.position[rows]
        distance = np.linalg.norm(towards, axis=1, keepdims=True)
        # Nothing within 0.6 m, everything beyond 1.6 m (chosen).
        strength = np.clip(distance - 0.6, 0.0, 1.0)
        return config.cohesion_mps2 * strength * towards / np.maximum(distance, 1e-9)


def repulsion(
    position: Float64Array, velocity: Float64Array, group: np.ndarray, config: SocialForceConfig
) -> Float64Array:
    """Return the [n, 2] accelerations away from the others (m/s^2).

    Args:
        position: [n, 2] (m).
        velocity: [n, 2] (m/s).
        group: [n] number of the group; members of a group may walk close to each other.
        config: the model.
    """
    away = position[:, None] - position[None]
    away = away + 1e-6
    now = np.linalg.norm(away, axis=2)
    # Where the relative motion leads to decides, halfway (elliptical specification, 2007).
    later = away + config.horizon_s * (velocity[:, None] - velocity[None])
    moved = np.linalg.norm(config.horizon_s * (velocity[:, None] - velocity[None]), axis=2)
    reach = np.linalg.norm(later, axis=2)
    axis = 0.5 * np.sqrt(np.maximum((now + reach) ** 2 - moved**2, 0.0))
    strength = config.repulsion_mps2 * np.exp((2 * config.radius_m - axis) / config.repulsion_m)
    direction = away / now[..., None] + later / np.maximum(reach, 1e-6)[..., None]
    direction /= np.maximum(np.linalg.norm(direction, axis=2, keepdims=True), 1e-6)
    speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-6)
    # Cosine of the angle between the own velocity and the direction to the other.
    cosine = -(away * velocity[:, None]).sum(axis=2) / (now * speed[:, None])
    strength = strength * (config.behind + (1 - config.behind) * (1 + cosine) / 2)
    together = (group[:, None] == group[None]) & (now > 2 * config.radius_m)
    strength[together] *= 0.3
    np.fill_diagonal(strength, 0.0)
    force: Float64Array = (strength[..., None] * direction).sum(axis=1)
    return force
