# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings common to all simulated sites, and the names that a command line has for sites."""

from __future__ import annotations

from dataclasses import dataclass

from mtpgo_core.options import LARGEST_SEED, check_options, option

SITE_NAMES = (
    *("highway", "roundabout", "street", "curves", "ramps"),
    *("junctions", "roundabouts", "crowd", "scenario"),
)
"""Names of the sites, see :data:`mtpgo_training.simulate.sites.SITES`."""

TRAFFIC_STATES = ("free", "dense", "congested", "stop-and-go")
"""Traffic states of a highway, from empty to full."""

LARGEST_FRAME_RATE = 1000.0
"""Most frames per second (Hz): the shortest step of SUMO is a millisecond."""

LARGEST_DEMAND = 1e5
"""Largest demand (vehicles/h); chosen: more than any road carries, and not more than fits into the
memory."""


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
        max_step_s: longest simulation step (s). With SUMO's car following and lateral motion are
            visibly rough above 0.04 s unless the motion is smoothed over more than 0.3 s.
        lateral_resolution_m: width of a sublane (m).
    """

    seconds: float = 60.0
    seed: int = option(1, low=0, high=LARGEST_SEED)
    frame_rate: float = option(25.0, low=1.0, high=LARGEST_FRAME_RATE)
    vehicles_per_hour: float | None = option(None, above=0.0, high=LARGEST_DEMAND)
    lanes: int | None = None
    truck_share: float | None = None
    warm_up_s: float = 120.0
    max_step_s: float = 0.04
    lateral_resolution_m: float = 0.4

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True)
class VariedConfig(SimulationConfig):
    """What is simulated on roads that are drawn; None is drawn from the seed.

    Frames and steps are coarser than elsewhere, for more roads in the same time. Paths are
    smoothed over 0.35 s and more, so that the steps do not show.
    """

    frame_rate: float = option(10.0, low=1.0, high=LARGEST_FRAME_RATE)
    warm_up_s: float = 75.0
    max_step_s: float = 0.1
    lateral_resolution_m: float = 0.8
