# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Geometry of curved roads, against circles."""

from __future__ import annotations

import itertools
from xml.etree import ElementTree

import numpy as np
import pytest

from mtpgo_training.simulate.varied import road_builder as roads


def circle(radius: float, turn: float) -> np.ndarray:
    """Return the line of a left turn."""
    return roads.curved_line([(radius * turn, 1 / radius)])


def test_a_piece_of_constant_curvature_is_an_arc() -> None:
    line = circle(50.0, np.pi / 2)
    np.testing.assert_allclose(np.linalg.norm(line - (0.0, 50.0), axis=1), 50.0, atol=0.02)
    np.testing.assert_allclose(roads.curvature_of(line)[2:-2], 1 / 50.0, rtol=1e-2)
    assert roads.headings_of(line)[-1] == pytest.approx(np.pi / 2, abs=0.05)


def test_a_shift_to_the_left_of_a_left_turn_reduces_its_radius() -> None:
    moved = roads.shifted(circle(50.0, 1.0), 5.0)
    np.testing.assert_allclose(np.linalg.norm(moved - (0.0, 50.0), axis=1), 45.0, atol=0.1)


def test_a_loop_comes_near_itself_and_an_arc_does_not() -> None:
    assert roads.comes_near_itself(circle(60.0, 2 * np.pi), 30.0)
    assert not roads.comes_near_itself(circle(60.0, np.pi), 30.0)


def test_the_speed_of_a_carriageway_follows_from_its_radius() -> None:
    builder = roads.RoadBuilder()
    line = roads.curved_line([(200.0, 0.0), (100.0, -1 / 50.0), (200.0, 0.0)])
    names = builder.carriageway(
        "road", line, lanes=1, lane_m=0.0, limit_mps=25.0, lateral_mps2=2.0
    )
    edges = [ElementTree.fromstring(xml).attrib for xml in builder.network().edges]
    assert [edge["id"] for edge in edges] == names
    speeds = [float(edge["speed"]) for edge in edges]
    # An edge has speeds that differ by 12 % at most; the bend begins on no edge of the straight.
    assert min(speeds[0], speeds[-1]) >= 25.0 / 1.12
    assert min(speeds) == pytest.approx(10.0, rel=0.03)  # v^2 / 50 m = 2 m/s^2
    for one, other in itertools.pairwise(edges):
        assert one["to"] == other["from"]
        assert one["shape"].split()[-1] == other["shape"].split()[0]


def test_a_road_user_is_in_view_with_its_whole_length() -> None:
    in_view = roads.box_view((10.0, 0.0), (20.0, 5.0))
    position = np.array([[27.0, 0.0], [29.0, 0.0], [10.0, 4.0], [29.0, 0.0]])
    size = np.array([[5.0, 2.0], [5.0, 2.0], [5.0, 2.0], [0.5, 0.5]])
    assert in_view(position, size).tolist() == [True, False, False, True]
