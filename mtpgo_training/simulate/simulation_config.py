# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the simulation of every site is told."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SimulationConfig:
    """What is simulated; ``None`` is drawn from the seed.

    Attributes:
        seconds: length of the recording (s).
        seed: of everything drawn.
        frame_rate: frames per second (Hz).
        vehicles_per_hour: demand.
        lanes: lanes.
        truck_share: part of trucks in the demand.
        warm_up_s: simulated before the first frame (s).
    """

    seconds: float = 60.0
    seed: int = 1
    frame_rate: float = 25.0
    vehicles_per_hour: float | None = None
    lanes: int | None = None
    truck_share: float | None = None
    warm_up_s: float = 120.0
