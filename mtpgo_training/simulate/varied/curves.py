# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a curved road: a country road, a ring road or a motorway with bends and S-curves.

The line of the road, its lanes and the traffic are drawn from the seed. Drivers slow down before
bends, because the speed limit of each part follows from its radius. Recordings are in inD layout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.drivers import Generator, between, departures
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import VariedConfig
from mtpgo_training.simulate.varied.road_builder import (
    SPACING_M,
    RoadBuilder,
    box_view,
    comes_near_itself,
    curved_line,
    shifted,
)
from mtpgo_training.simulate.varied.varied_drivers import draw_varied_types, motor_shares

DIRECTIONS = ("forward", "backward")

_VIEW_M = 220.0
"""Half the edge of the square image (m). Chosen: some 500 m of road, 20 to 60 vehicles."""


@dataclass(frozen=True)
class _Style:
    """Ranges of one style of road; all chosen.

    Attributes:
        radius_m: radii of its curves.
        lanes: lanes per direction.
        limit_mps: speed limits.
        per_hour: demand per lane.
        median_m: width between the directions.
        turn_deg: change of direction in one curve.
    """

    radius_m: tuple[float, float]
    lanes: tuple[int, int]
    limit_mps: tuple[float, float]
    per_hour: tuple[float, float]
    median_m: tuple[float, float]
    turn_deg: tuple[float, float]


STYLES = {
    "lane": _Style((30, 90), (1, 1), (11, 17), (500, 1100), (0.3, 0.5), (30, 130)),
    "country": _Style((60, 250), (1, 1), (16, 27), (600, 1300), (0.3, 1.0), (20, 110)),
    "ring": _Style((90, 350), (2, 3), (13, 23), (500, 1200), (1.0, 4.0), (30, 150)),
    "motorway": _Style((220, 800), (2, 3), (22, 37), (700, 1600), (2.5, 6.0), (15, 80)),
}
"""Style of road -> its ranges."""


@dataclass(frozen=True)
class CurvesConfig(VariedConfig):
    """What is simulated; None is drawn from the seed.

    Demand and ``lanes`` are per direction.

    Attributes:
        style: one of ``STYLES``.
        speed_limit_mps: speed limit where the road is straight (m/s).
    """

    lanes: int | None = option(None, low=1, high=4)
    style: str | None = option(None, choices=tuple(STYLES))
    speed_limit_mps: float | None = None


def simulate_curves(config: CurvesConfig, name: str = "00") -> Recording:
    """Return one recording of a curved road.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    style = STYLES[config.style or str(generator.choice(list(STYLES)))]
    line = _draw_line(generator, style)
    lanes = config.lanes or int(generator.integers(style.lanes[0], style.lanes[1] + 1))
    types, probability = draw_varied_types(
        generator, motor_shares(generator, config.truck_share, 0.2)
    )
    builder = RoadBuilder()
    lane_m, gap = between(generator, 3.0, 3.8), between(generator, *style.median_m)
    limit = config.speed_limit_mps or between(generator, *style.limit_mps)
    lateral = between(generator, 2.0, 3.5)
    elements: list[tuple[float, str]] = []
    routes = []
    for side, way in zip(DIRECTIONS, (line, line[::-1]), strict=True):
        edges = builder.carriageway(
            side,
            shifted(way, -gap / 2),
            lanes=lanes,
            lane_m=lane_m,
            limit_mps=limit,
            lateral_mps2=lateral,
        )
        routes.append(f'<route id="{side}" edges="{" ".join(edges)}"/>')
        per_hour = config.vehicles_per_hour or lanes * between(generator, *style.per_hour)
        for departure in departures(config, generator, per_hour, types, probability):
            elements.append(
                (
                    departure.time_s,
                    f'<vehicle id="{side}.{departure.number}" type="{departure.kind.name}" '
                    f'route="{side}" depart="{departure.time_s:.2f}" '
                    f'departLane="{generator.integers(lanes)}" departSpeed="max" '
                    'departPos="base"/>',
                )
            )
    seen = sumo.run_simulation(
        builder.network(), types, [*routes, *(xml for _, xml in sorted(elements))], config
    )
    middle = line[len(line) // 2]
    view = box_view(middle, (_VIEW_M, _VIEW_M))
    return make_recording(seen, types, view, config, name=name, layout="ind")


def _draw_line(generator: Generator, style: _Style) -> Float64Array:
    """Draw the [n, 2] middle line of a road that crosses the image (m)."""
    while True:
        pieces: list[tuple[float, float]] = []
        side = float(generator.choice([-1.0, 1.0]))
        while sum(length for length, _ in pieces) < 1300.0:
            # Small radii are as frequent as large ones on a logarithmic scale.
            radius = float(np.exp(generator.uniform(*np.log(style.radius_m))))
            turn = np.radians(between(generator, *style.turn_deg))
            pieces.append((max(radius * turn, 3 * SPACING_M), side / radius))
            if generator.random() < 0.5:
                pieces.append((between(generator, 10.0, 120.0), 0.0))
            if generator.random() < 0.75:
                side = -side
        line = curved_line(pieces, heading=between(generator, -np.pi, np.pi))
        if not comes_near_itself(line, 40.0):
            return line
