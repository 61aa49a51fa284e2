# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Ways on along lanes, and how they stand for trails that are not known."""

import itertools

import numpy as np
import pytest
from trail_lines import DT_S, along, bend, drive, window_at

from mtpgo_core.frames import Pose2, rotate
from mtpgo_core.maps.lane_lines import beside
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.trails.lane_ways import GAP_M, lane_ways
from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.schema import AgentClass

H = 25
WIDTH_M = 3.5


def lanes_along(*lines, pieces=1):
    """The two edges of a lane around each line, cut into pieces that follow each other."""
    edges = []
    for line in lines:
        for side in (0.5 * WIDTH_M, -0.5 * WIDTH_M):
            edge = beside(np.asarray(line, float), side)
            cuts = np.unique(np.linspace(0, len(edge) - 1, pieces + 1).round().astype(int))
            edges += [edge[a : b + 1] for a, b in itertools.pairwise(cuts)]
    return LaneMap(edges)


def way(lanes, position=(0.0, 0.0), heading=0.0, speed=8.0):
    distance = speed * DT_S * np.arange(1, H + 1)[None]
    places, reach = lane_ways(lanes, np.array([position], float), np.array([heading]), distance)
    return places[0], int(reach[0]), distance[0]


def ahead_of(line, distance, aside=0.0):
    """Places along a bend from the origin on, ``aside`` m to its left."""
    place, course = along(line, 40.0 + distance)
    return place + aside * np.stack([-course[:, 1], course[:, 0]], axis=1)


@pytest.mark.parametrize("turn", [1, 0, -1])
@pytest.mark.parametrize("aside", [0.0, 0.8])
@pytest.mark.parametrize("pieces", [1, 4])
def test_a_way_follows_the_lane_beside_its_middle_as_the_agent_is(turn, aside, pieces):
    lanes = lanes_along(bend(turn), pieces=pieces)
    places, reach, distance = way(lanes, (0.0, aside))
    assert reach == H
    # On the inner side of the bend the same distance leads farther along it.
    middle = ahead_of(bend(turn), np.linspace(0.0, 60.0, 601), aside)
    error = np.hypot(*(places[:, None] - middle).transpose(2, 0, 1)).min(axis=1)
    assert error.max() < 0.1
    gone = np.cumsum(np.hypot(*np.diff(places, axis=0, prepend=[[0.0, aside]]).T))
    np.testing.assert_allclose(gone, distance, rtol=0.02)


def test_who_is_on_a_line_goes_beside_it():
    places, _, _ = way(lanes_along(bend(0)), (0.0, 1.7))
    np.testing.assert_allclose(places[:, 1], 0.35 * WIDTH_M)


@pytest.mark.parametrize(("gap_m", "known_m"), [(0.5 * GAP_M, 40.0), (2.0 * GAP_M, 10.0)])
def test_a_way_goes_on_over_a_short_gap_only(gap_m, known_m):
    parts = [[[-20.0, 0.0], [10.0, 0.0]], [[10.0 + gap_m, 0.0], [90.0, 0.0]]]
    places, reach, distance = way(lanes_along(*parts))
    assert reach == (distance <= known_m).sum()
    np.testing.assert_allclose(places[:reach], ahead_of(bend(0), distance)[:reach], atol=1e-9)
    assert np.isnan(places[reach:]).all()


@pytest.mark.parametrize(
    ("position", "heading"),
    [((0.0, 5.0), 0.0), ((0.0, 0.0), 0.9), ((0.0, 0.0), np.pi), ((0.0, 0.0), np.nan)],
)
def test_outside_of_lanes_across_or_against_them_there_is_no_way(position, heading):
    lanes = lanes_along(bend(0))
    places, reach, _ = way(lanes, position, heading)
    assert reach == 0
    assert np.isnan(places).all()
    assert way(LaneMap(()))[1] == 0


def test_ways_are_in_the_frame_of_the_agents():
    lanes, pose = lanes_along(bend(1)), Pose2(30.0, -7.0, 0.8)
    expected, reach, _ = way(lanes)
    given, same, _ = way(lanes.seen_from(pose), pose.inverse_point(np.zeros(2)), -0.8)
    assert same == reach
    np.testing.assert_allclose(pose.point(given), expected, atol=1e-9)


def features(memory, lanes, *, speed=8.0, kind=AgentClass.CAR, course=0.0):
    velocity = speed * np.array([np.cos(course), np.sin(course)])
    window = window_at(60.0, [9], [0.0, 0.0], velocity, kind=kind)
    return trail_features(window, TrailContext(memory, H, DT_S), lanes)[0]


def test_without_trails_the_lane_is_the_one_branch():
    given = features(TrailMemory(), lanes_along(bend(1)), course=0.1)
    distance = 8.0 * DT_S * np.arange(1, H + 1)
    expected = rotate(ahead_of(bend(1), distance), -0.1)
    np.testing.assert_allclose(given[0, :, 0] + distance, expected[:, 0], atol=0.2)
    np.testing.assert_allclose(given[0, :, 1], expected[:, 1], atol=0.2)
    np.testing.assert_array_equal(given[0, :, 2], 1.0)
    assert not given[1:].any()
    walking = features(TrailMemory(), lanes_along(bend(1)), kind=AgentClass.PEDESTRIAN)
    assert not walking.any()


def test_a_branch_that_ends_goes_on_along_its_lane():
    memory, whole = TrailMemory(), TrailMemory()
    drive(memory, bend(1, after=1.0), ident=1, aside_m=0.3)
    drive(whole, bend(1), ident=1, aside_m=0.3)
    short = features(memory, None)
    known = short[0, :, 2] > 0.0
    assert 10 < known.sum() < 20
    given, expected = features(memory, lanes_along(bend(1))), features(whole, None)
    np.testing.assert_array_equal(given[0][known], short[0][known])
    np.testing.assert_array_equal(given[0, :, 2], 1.0)
    np.testing.assert_allclose(given[0], expected[0], atol=0.5)


def test_lanes_change_nothing_where_trails_are_known_or_lead_elsewhere():
    memory = TrailMemory()
    drive(memory, bend(1), ident=1)
    known = features(memory, None)
    np.testing.assert_array_equal(features(memory, lanes_along(bend(1))), known)
    np.testing.assert_array_equal(features(memory, lanes_along(bend(-1))), known)
