# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts SUMO's front bumper positions into the motion of vehicle centres.

SUMO moves the front bumper along lane centres with sharp corners, changes lanes at constant
lateral speed and keeps the lane exactly. Here every path is smoothed, given a small filtered
random wander, and followed by a vehicle whose rear axle trails the front bumper, so that position,
velocity, acceleration and heading of the centre are consistent.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.simulate.motion_config import MotionConfig
from mtpgo_training.simulate.sumo import FloatingCarData

REAR_AXLE = 0.8
"""Distance from the front bumper to the rear axle, as a share of the length. Chosen."""

_JUMP_MPS = 5.0
"""No pedestrian moves faster (m/s). Chosen: far above the desired speeds."""

_TURNING_MPS = 0.3
"""Below this speed a pedestrian's heading turns more slowly than the velocity (m/s). Chosen: less
than the slowest walk."""


@dataclass(frozen=True)
class CentreMotion:
    """Motion of vehicle centres; rows as in :class:`FloatingCarData` without some at the ends.

    Attributes:
        rows: [rows] index into the rows of the input.
        position: [rows, 2] position (m).
        velocity: [rows, 2] velocity (m/s).
        acceleration: [rows, 2] acceleration (m/s^2).
        yaw: [rows] heading, not wrapped (rad).
    """

    rows: np.ndarray
    position: Float64Array
    velocity: Float64Array
    acceleration: Float64Array
    yaw: Float64Array


def centre_motion(
    seen: FloatingCarData,
    length: Float64Array,
    frame_rate: float,
    configs: Sequence[MotionConfig],
    seed: int,
) -> CentreMotion:
    """Return the motion of the centres.

    Args:
        seen: front bumpers.
        length: [vehicles] lengths (m).
        frame_rate: frames per second (Hz).
        configs: [vehicles] smoothing and wander of each.
        seed: seed of the wander.
    """
    generator = np.random.default_rng(seed)
    dt = 1.0 / frame_rate
    pieces = []
    # A vehicle that leaves the observed edges and returns is several pieces, and so is a
    # pedestrian that SUMO moves to the side at once.
    walks = np.array([not config.trailing for config in configs])[seen.vehicle[1:]]
    jumps = walks & (np.linalg.norm(np.diff(seen.front, axis=0), axis=1) > _JUMP_MPS * dt)
    breaks = np.flatnonzero((np.diff(seen.vehicle) != 0) | (np.diff(seen.step) != 1) | jumps) + 1
    bounds = [0, *breaks.tolist(), len(seen.step)]
    for start, end in itertools.pairwise(bounds):
        if end - start < 5:
            continue
        config = configs[seen.vehicle[start]]
        front = _smooth(seen.front[start:end], config.smoothing_s * frame_rate)
        speed = np.linalg.norm(np.gradient(front, dt, axis=0), axis=1)
        heading = np.unwrap(seen.heading[start:end])
        forward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        left = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
        surge = config.surge_m * _wander(speed, dt, config, generator)[:, None]
        wander = config.wander_m * _wander(speed, dt, config, generator)[:, None]
        front += _smooth(
            surge * forward + (wander + config.offset_m) * left, config.smoothing_s * frame_rate
        )
        if config.trailing:
            own_length = float(length[seen.vehicle[start]])
            yaw = _trail(front, REAR_AXLE * own_length, float(heading[0]))
            ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
            position = front - own_length / 2 * ahead
        else:
            position, yaw = front, _walking_heading(front, dt, float(heading[0]))
        velocity = np.gradient(position, dt, axis=0)
        acceleration = np.gradient(velocity, dt, axis=0)
        # Without the outermost samples, whose differences are one-sided.
        inner = slice(2, -2)
        pieces.append(
            (
                np.arange(start, end)[inner],
                position[inner],
                velocity[inner],
                acceleration[inner],
                yaw[inner],
            )
        )
    if not pieces:
        empty = np.empty((0, 2))
        return CentreMotion(np.empty(0, dtype=np.int64), empty, empty, empty, np.empty(0))
    return CentreMotion(*(np.concatenate(column) for column in zip(*pieces, strict=True)))


def _smooth(path: Float64Array, sigma: float) -> Float64Array:
    """Return an [n, k] path after a Gaussian of ``sigma`` samples, point-mirrored at its ends."""
    reach = min(int(np.ceil(3 * sigma)), len(path) - 1)
    if reach < 1:
        return path
    offsets = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (offsets / sigma) ** 2)
    kernel /= kernel.sum()
    before = 2 * path[0] - path[reach:0:-1]
    after = 2 * path[-1] - path[-2 : -reach - 2 : -1]
    padded = np.concatenate([before, path, after])
    return np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=1)


def _wander(
    speed: Float64Array, dt: float, config: MotionConfig, generator: np.random.Generator
) -> Float64Array:
    """Return an [n] offset of unit variance: white noise through two low-pass filters.

    Below ``config.wander_speed_mps`` the filters slow down with the vehicle.
    """
    own_time = np.minimum(speed / config.wander_speed_mps, 1.0) * dt
    # Unit white noise after the two equal low-pass filters has the variance 1 / (4 tau).
    tau = config.wander_time_s
    scale = np.sqrt(4 * tau)
    noise = generator.standard_normal(len(speed))
    first, second = generator.standard_normal(2)
    # Start in the stationary state: variances 1/(2 tau) and 1/(4 tau), covariance 1/(4 tau).
    inner = first / np.sqrt(2 * tau)
    outer = inner / 2 + second * np.sqrt(1 / (8 * tau))
    out = np.empty(len(speed))
    for i, step in enumerate(own_time):
        out[i] = outer
        outer += (inner - outer) * step / tau
        inner += -inner * step / tau + noise[i] * np.sqrt(step) / tau
    return scale * out


def _trail(front: Float64Array, wheelbase: float, heading: float) -> Float64Array:
    """Return the [n] heading (rad) of a vehicle whose rear axle trails its front at a distance."""
    yaw = np.empty(len(front))
    x = front[0, 0] - wheelbase * np.cos(heading)
    y = front[0, 1] - wheelbase * np.sin(heading)
    for i, (fx, fy) in enumerate(front.tolist()):
        angle = math.atan2(fy - y, fx - x)
        yaw[i] = angle
        x = fx - wheelbase * math.cos(angle)
        y = fy - wheelbase * math.sin(angle)
    return np.unwrap(yaw)


def _walking_heading(path: Float64Array, dt: float, heading: float) -> Float64Array:
    """Return the [n] heading (rad) of a pedestrian: that of the velocity, kept while standing."""
    facing = np.array([math.cos(heading), math.sin(heading)])
    out = np.empty(len(path))
    for i, velocity in enumerate(np.gradient(path, dt, axis=0)):
        speed = float(np.hypot(*velocity))
        # A first-order filter that is the faster, the faster the pedestrian walks.
        share = min(1.0, (speed / _TURNING_MPS) ** 2 * dt / 0.2)
        if speed > 1e-6:
            facing = (1 - share) * facing + share * velocity / speed
        out[i] = math.atan2(facing[1], facing[0])
    return np.unwrap(out)
