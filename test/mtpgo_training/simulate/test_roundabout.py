# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Network and routes of the simulated roundabout."""

from __future__ import annotations

import itertools
from xml.etree import ElementTree

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.simulate import roundabout
from mtpgo_training.simulate.roundabout import CENTRE, RoundaboutConfig


def edges(radius: float = 15.0, lanes: int = 1) -> dict[str, dict[str, str]]:
    """Return the attributes of the network's edges by name."""
    elements = map(ElementTree.fromstring, roundabout.ring_network(radius, lanes).edges)
    return {e.attrib["id"]: e.attrib for e in elements if e.tag == "edge"}


def shape(edge: dict[str, str]) -> np.ndarray:
    """Return the [k, 2] points of an edge from the centre of the roundabout (m)."""
    points = [tuple(map(float, point.split(","))) for point in edge["shape"].split()]
    return np.array(points) - CENTRE


@pytest.mark.parametrize("lanes", [1, 2])
def test_the_ring_is_closed_and_runs_counter_clockwise(lanes: int) -> None:
    found = edges(lanes=lanes)
    ring = [name for arm in range(4) for name in (f"mouth{arm}", f"ring{arm}")]
    paths = [shape(found[name]) for name in ring]
    for name, path, following in zip(ring, paths, [*paths[1:], paths[0]], strict=True):
        np.testing.assert_allclose(np.linalg.norm(path, axis=1), 15.0, atol=1e-3)
        turn = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
        assert (np.diff(turn) > 0).all(), name
        np.testing.assert_allclose(path[-1], following[0], atol=1e-3)
    assert sum(np.ptp(np.unwrap(np.arctan2(p[:, 1], p[:, 0]))) for p in paths) == pytest.approx(
        2 * np.pi, abs=1e-3
    )


def test_entering_traffic_yields_and_the_ring_is_driven_slowly() -> None:
    found = edges(radius=15.0, lanes=2)
    assert all(
        int(found[f"in{arm}"]["priority"]) < int(found["ring0"]["priority"]) for arm in range(4)
    )
    # v^2 / r = 2.6 m/s^2 in the middle of two lanes of 3.6 m around an island of 15 m.
    speed = float(found["ring0"]["speed"])
    assert speed**2 / (15.0 + 3.6) == pytest.approx(2.6, rel=1e-2)


def test_routes_are_connected_and_lead_from_every_arm_to_every_other() -> None:
    found = edges()
    ends = set()
    for element in map(ElementTree.fromstring, roundabout.ring_routes()):
        names = element.attrib["edges"].split()
        for one, other in itertools.pairwise(names):
            assert found[one]["to"] == found[other]["from"]
        ends.add((names[0], names[-1]))
        assert len(set(names)) == len(names)
    assert ends == {(f"in{i}", f"out{k}") for i in range(4) for k in range(4) if i != k}


def test_traffic_drives_on_the_right_of_each_arm() -> None:
    found = edges()
    for arm, angle in enumerate(np.arange(4) * np.pi / 2):
        left_of_outward = np.array([-np.sin(angle), np.cos(angle)])
        # Inbound traffic keeps to the left of the outward direction, outbound to its right.
        assert (shape(found[f"in{arm}"]) @ left_of_outward > 0).all()
        assert (shape(found[f"out{arm}"]) @ left_of_outward < 0).all()


def test_a_vehicle_is_in_view_where_the_longest_one_would_fit_into_the_image() -> None:
    position = CENTRE + np.array([[0.0, 0.0], [-55.9, 0.0], [56.1, 0.0], [0.0, 52.1]])
    cars = np.tile([4.0, 1.8], (4, 1))  # half a car is 2 m, the image ends at 58 m
    assert roundabout._in_view(position, cars).tolist() == [True, True, False, True]
    with_truck = np.array([[12.0, 2.5], *cars[1:]])
    assert roundabout._in_view(position, with_truck).tolist() == [True, False, False, False]


def test_three_lanes_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="lanes is 3, expected 1 to 2"):
        RoundaboutConfig(lanes=3)
