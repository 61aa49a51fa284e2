# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane and road positions: the paper's formula on straight lanes, geometry on curved ones."""

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.scene.lane_map import LaneMap

EASTBOUND = [0.0, 3.5, 7.5, 11.0]  # right to left for traffic towards +x
WESTBOUND = [15.0, 18.5, 22.0]  # left to right for traffic towards -x


def straight_road():
    lines = [np.array([[0.0, y], [400.0, y]]) for y in EASTBOUND]
    lines += [np.array([[400.0, y], [0.0, y]]) for y in WESTBOUND]
    return LaneMap(lines)


def paper(offset_from_left, width):
    return 2.0 * offset_from_left / width - 1.0


def test_straight_lanes_follow_the_papers_formula():
    y = np.array([1.0, 3.4, 5.0, 7.0, 10.9])
    lane = [(3.5, 3.5), (3.5, 3.5), (7.5, 4.0), (7.5, 4.0), (11.0, 3.5)]
    given = straight_road().positions(np.stack([np.full(5, 120.0), y], axis=1), np.zeros(5))
    expected = [
        [paper(left - at, width), paper(11.0 - at, 11.0)]
        for at, (left, width) in zip(y, lane, strict=True)
    ]
    np.testing.assert_allclose(given, expected, atol=1e-12)


def test_the_other_carriageway_is_not_looked_at():
    given = straight_road().positions(np.array([[50.0, 16.0]]), np.array([np.pi]))
    np.testing.assert_allclose(given, [[paper(1.0, 3.5), paper(1.0, 7.0)]], atol=1e-12)


def test_left_is_minus_one_and_right_is_one():
    left, right = straight_road().positions(
        np.array([[10.0, 10.999999], [10.0, 0.000001]]), np.zeros(2)
    )
    np.testing.assert_allclose(left, [-1.0, -1.0], atol=1e-5)
    np.testing.assert_allclose(right, [1.0, 1.0], atol=1e-5)


def test_off_the_road_and_unknown_are_nan():
    road = straight_road()
    points = np.array([[50.0, -1.0], [50.0, 12.0], [-5.0, 2.0], [50.0, 2.0], [np.nan, 2.0]])
    yaw = np.array([0.0, 0.0, 0.0, np.nan, 0.0])
    assert np.isnan(road.positions(points, yaw)).all()
    assert np.isnan(LaneMap([]).positions(points, yaw)).all()
    assert LaneMap([]).positions(points[:0], yaw[:0]).shape == (0, 2)


def test_a_step_too_wide_for_a_lane_ends_the_road():
    lines = [np.array([[0.0, y], [100.0, y]]) for y in (0.0, 3.0, 6.0, 30.0, 33.0)]
    given = LaneMap(lines, max_lane_width_m=8.0).positions(
        np.array([[50.0, 4.0], [50.0, 31.0], [50.0, 20.0]]), np.zeros(3)
    )
    np.testing.assert_allclose(given[0], [paper(2.0, 3.0), paper(2.0, 6.0)])
    np.testing.assert_allclose(given[1], [paper(2.0, 3.0), paper(2.0, 3.0)])
    assert np.isnan(given[2]).all()


def test_a_bend_is_measured_across_it():
    angle = np.linspace(-0.5, 2.0, 800)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    road = LaneMap([50.0 * circle, 46.0 * circle, 54.0 * circle])  # counter-clockwise
    for at in (0.0, 0.7, 1.5):
        point = 47.0 * np.array([[np.cos(at), np.sin(at)]])
        given = road.positions(point, np.array([at + np.pi / 2]))
        # The left line of a left-hand bend is the inner one.
        np.testing.assert_allclose(given, [[paper(1.0, 4.0), paper(1.0, 8.0)]], atol=1e-3)


def test_the_sides_of_a_lane_are_its_lines_and_its_direction():
    points = np.array([[50.0, 5.0], [50.0, 16.0], [50.0, 12.5], [np.nan, 5.0]])
    left, right, turn = straight_road().sides(points, np.array([0.1, np.pi, 0.0, 0.0]))
    np.testing.assert_allclose(left[:2], [2.5 / np.cos(0.1), 1.0])
    np.testing.assert_allclose(right[:2], [-1.5 / np.cos(0.1), -2.5])
    np.testing.assert_allclose(turn[:2], [-0.1, 0.0], atol=1e-12)
    assert np.isnan([left[2:], right[2:], turn[2:]]).all()
    wedge = LaneMap([np.array([[0.0, 4.0], [40.0, 8.0]]), np.array([[0.0, 0.0], [40.0, 0.0]])])
    (_, _, turn) = wedge.sides(np.array([[10.0, 1.25]]), np.zeros(1))
    np.testing.assert_allclose(turn, 0.25 * np.arctan(0.1))  # a quarter of the way to the left


def test_turning_the_world_changes_nothing():
    draw = np.random.default_rng(0)
    points = draw.uniform([0.0, -2.0], [400.0, 13.0], (200, 2))
    yaw = draw.normal(scale=0.1, size=200)
    lines = [np.array([[-100.0, y], [200.0, y + 1.0], [500.0, y]]) for y in EASTBOUND]
    expected = LaneMap(lines).positions(points, yaw)
    turn = np.array([[np.cos(1.1), -np.sin(1.1)], [np.sin(1.1), np.cos(1.1)]])
    turned = LaneMap([line @ turn.T for line in lines]).positions(points @ turn.T, yaw + 1.1)
    np.testing.assert_allclose(turned, expected, atol=1e-9)
    assert np.isfinite(expected).any()


def test_many_points_are_served_in_pieces(monkeypatch):
    road = straight_road()
    draw = np.random.default_rng(1)
    points = draw.uniform([0.0, 0.0], [400.0, 11.0], (50, 16, 2))
    whole = road.positions(points, np.zeros((50, 16)))
    monkeypatch.setattr("mtpgo_core.scene.lane_map._POINTS_AT_ONCE", 30)
    np.testing.assert_array_equal(road.positions(points, np.zeros((50, 16))), whole)
    assert whole.shape == (50, 16, 2)


@pytest.mark.parametrize(
    ("line", "message"),
    [([[0.0, 0.0]], "expected .k, 2. with k >= 2"), ([[0.0, 0.0], [np.nan, 1.0]], "not finite")],
)
def test_a_line_that_is_none_is_an_error(line, message):
    with pytest.raises(ConfigurationError, match=f"lane line 1 .*{message}"):
        LaneMap([np.array([[0.0, 0.0], [1.0, 0.0]]), np.array(line)])


def test_a_line_of_another_direction_belongs_to_another_road():
    across = np.array([[45.0, -5.0], [52.0, 20.0]])  # 74 degrees
    road = LaneMap([*(np.array([[0.0, y], [100.0, y]]) for y in (0.0, 4.0)), across])
    given = road.positions(np.array([[47.0, 1.0]]), np.zeros(1))
    np.testing.assert_allclose(given, [[paper(3.0, 4.0)] * 2])


def test_many_lines_give_the_same_as_few(monkeypatch):
    draw = np.random.default_rng(2)
    lines, points, yaw = [], [], []
    for _ in range(12):
        heading = draw.uniform(-np.pi, np.pi) + np.linspace(0.0, draw.normal(), 60)
        steps = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        line = draw.uniform(-100.0, 100.0, 2) + np.cumsum(2.0 * steps, axis=0)
        left = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
        lines += [line + offset * left for offset in (-1.7, 1.7, 5.0)]
        points.append(line + draw.normal(scale=3.0, size=line.shape))
        yaw.append(heading + draw.normal(scale=0.2, size=60))
    points, yaw = np.concatenate(points), np.concatenate(yaw)
    with_grid = LaneMap(lines)
    assert with_grid._grid is not None
    monkeypatch.setattr("mtpgo_core.scene.lane_map._SMALL", 10**6)
    one_by_one = LaneMap(lines)
    expected = one_by_one.positions(points, yaw)
    np.testing.assert_allclose(with_grid.positions(points, yaw), expected, atol=1e-12)
    assert np.isfinite(expected).mean() > 0.3
    left, right, turn = with_grid.sides(points, yaw)
    np.testing.assert_allclose(2.0 * left / (left - right) - 1.0, expected[:, 0], atol=1e-9)
    np.testing.assert_allclose(one_by_one.sides(points, yaw).turn_rad, turn, atol=1e-9)
    far = points[:5] + 3000.0
    assert abs(with_grid.distance_m(far) - one_by_one.distance_m(far)) < 23.0
    assert LaneMap([]).distance_m(far) == LaneMap(lines).distance_m(far[:0]) == np.inf
