# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lanes and connections of the simulated street."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from mtpgo_training.simulate.street_network import (
    MAIN_ENDS,
    SIDE_ENDS,
    entry,
    exit_at,
    make_network,
)

LANES = 2
LIMIT_MPS = 13.4


@pytest.fixture(scope="module")
def network():
    return make_network(
        np.random.default_rng(4), middle=(100.0, -50.0), lanes=LANES, speed_limit_mps=LIMIT_MPS
    )


@pytest.fixture(scope="module")
def edges(network):
    """The attributes of the edges by name."""
    elements = map(ElementTree.fromstring, network.edges)
    return {element.attrib["id"]: element.attrib for element in elements}


@pytest.fixture(scope="module")
def connections(network):
    """From, to and both lanes of each connection."""
    elements = map(ElementTree.fromstring, network.connections)
    return [
        (e.attrib["from"], e.attrib["to"], int(e.attrib["fromLane"]), int(e.attrib["toLane"]))
        for e in elements
    ]


def shape(edge):
    """Return the [k, 2] points of an edge from the middle of the street (m)."""
    points = [tuple(map(float, point.split(","))) for point in edge["shape"].split()]
    return np.array(points) - (100.0, -50.0)


def direction(edge):
    """Return the [2] unit vector along an edge."""
    path = shape(edge)
    return (path[-1] - path[0]) / np.linalg.norm(path[-1] - path[0])


def test_connections_join_edges_at_a_node_on_lanes_that_exist(edges, connections):
    for one, other, from_lane, to_lane in connections:
        assert edges[one]["to"] == edges[other]["from"]
        assert from_lane < int(edges[one]["numLanes"])
        assert to_lane < int(edges[other]["numLanes"])
    assert len(set(connections)) == len(connections)


def test_every_end_leads_to_every_other_and_not_back(edges, connections):
    ends = (*MAIN_ENDS, *SIDE_ENDS)
    following = {name: {other for one, other, *_ in connections if one == name} for name in edges}
    for end in ends:
        reached, new = set(), {entry(end)}
        while new:
            reached |= new
            new = set().union(*(following[name] for name in new)) - reached
        assert {other for other in ends if exit_at(other) in reached} == set(ends) - {end}


def test_left_turns_have_a_lane_of_their_own_and_right_turns_the_rightmost(edges, connections):
    turns = {"left": set(), "straight": set(), "right": set()}
    for one, other, from_lane, to_lane in connections:
        if one == other.removesuffix(".turn"):
            continue  # where the turn lane opens
        a, b = direction(edges[one]), direction(edges[other])
        side = a[0] * b[1] - a[1] * b[0]
        kind = "left" if side > 0.5 else "right" if side < -0.5 else "straight"
        # Counted from the right; the leftmost lane is the turn lane.
        left = int(edges[one]["numLanes"]) - 1
        turns[kind].add((from_lane == left, from_lane == 0, to_lane == 0))
    assert {turn[0] for turn in turns["left"]} == {True}
    assert turns["right"] == {(False, True, True)}
    assert {turn[0] for turn in turns["straight"]} == {False}


def test_traffic_drives_on_the_right(edges):
    for name in (entry("west"), exit_at("east"), "left.right"):  # eastward
        assert (shape(edges[name])[:, 1] < 0).all()
    for name in (entry("east"), exit_at("west"), "right.left"):  # westward
        assert (shape(edges[name])[:, 1] > 0).all()


def test_crossing_roads_have_a_lower_speed_limit(edges):
    for end in MAIN_ENDS:
        assert float(edges[entry(end)]["speed"]) == pytest.approx(LIMIT_MPS)
        assert int(edges[entry(end)]["numLanes"]) == LANES
    for end in SIDE_ENDS:
        assert float(edges[entry(end)]["speed"]) == pytest.approx(11.2)
    slow = make_network(np.random.default_rng(4), middle=(0.0, 0.0), lanes=1, speed_limit_mps=9.0)
    assert all('speed="9.00"' in edge for edge in slow.edges)
