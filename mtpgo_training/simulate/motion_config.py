# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How the path of a simulated road user becomes a motion: smoothing and random wander."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MotionConfig:
    """Smoothing and random wander of a path; all values are chosen.

    Attributes:
        smoothing_s: standard deviation of the Gaussian filter over time (s).
        wander_m: standard deviation of the lateral wander (m).
        surge_m: standard deviation of the longitudinal wander (m), which varies the speed.
        wander_time_s: time constant of each of the two low-pass filters of the wander (s).
        wander_speed_mps: below this speed the wander slows down with the road user (m/s).
        offset_m: constant lateral offset from the path, positive to the left (m).
        trailing: a rear axle follows the front, as of a vehicle; without, the path is that of the
            centre and the heading is that of the velocity, as of a pedestrian.
    """

    smoothing_s: float = 0.3
    wander_m: float = 0.12
    surge_m: float = 0.35
    wander_time_s: float = 2.0
    wander_speed_mps: float = 8.0
    offset_m: float = 0.0
    trailing: bool = True
