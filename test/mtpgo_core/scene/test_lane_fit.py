# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines that belong to another place, or are turned, are noticed; right ones are not."""

import numpy as np
import pytest

from mtpgo_core.scene.lane_fit import LaneFit
from mtpgo_core.scene.lane_map import LaneMap

ALONG = [np.array([[-500.0, y], [2000.0, y]]) for y in (2.0, -2.0)]


def looked(lines, times=20, *, agents=4, speed_mps=10.0):
    """Return what is found after some looks at cars in a row along x."""
    fit = LaneFit()
    for number in range(times):
        along = 12.0 * np.arange(agents) + speed_mps * number
        position = np.stack([along, np.zeros(agents)], axis=1)
        velocity = np.tile([speed_mps, 0.0], (agents, 1))
        fit.look(LaneMap(lines), position, velocity, np.ones(agents, dtype=np.uint8))
    return fit


def test_lines_along_the_traffic_fit():
    fit = looked(ALONG)
    assert fit.problem == ""
    assert fit.values == {"lane_distance_m": "2", "in_lane": "1.00"}


@pytest.mark.parametrize("shift", [(30_000.0, 0.0), (0.0, -4e6)])
def test_lines_far_away_are_named_at_once(shift):
    assert "no lane line within 1 km" in looked([line + shift for line in ALONG], 1).problem


@pytest.mark.parametrize(
    "lines", [[np.add(line, (0.0, 60.0)) for line in ALONG], [line[::-1] for line in ALONG]]
)
def test_lines_beside_or_against_the_traffic_are_named_after_a_while(lines):
    assert looked(lines, 2).problem == ""
    assert looked(lines).problem == "no vehicle that moves is in a lane"


def test_standing_vehicles_and_an_empty_road_say_nothing():
    assert looked([np.add(line, (0.0, 60.0)) for line in ALONG], speed_mps=0.0).problem == ""
    assert looked(ALONG, agents=0).values["in_lane"] == ""
    assert looked([]).problem == ""
