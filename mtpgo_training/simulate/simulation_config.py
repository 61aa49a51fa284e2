# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings common to all simulated sites."""

from __future__ import annotations

from dataclasses import dataclass

from mtpgo_core.options import check_options


@dataclass(frozen=True)
class SimulationConfig:
    """What is simulated; None is drawn from the seed.

    Attributes:
        seconds: length of the recording (s).
        seed: seed of all random numbers.
        frame_rate: frames per second (Hz).
        vehicles_per_hour: demand (vehicles/h).
        lanes: number of lanes.
        truck_share: share of trucks in the demand, 0 to 1.
        warm_up_s: simulated time before the first frame (s).
    """

    seconds: float = 60.0
    seed: int = 1
    frame_rate: float = 25.0
    vehicles_per_hour: float | None = None
    lanes: int | None = None
    truck_share: float | None = None
    warm_up_s: float = 120.0

    def __post_init__(self) -> None:
        check_options(self)
