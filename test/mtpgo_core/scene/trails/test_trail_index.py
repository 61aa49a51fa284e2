# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The index of trail points against a search through all of them."""

import numpy as np
import pytest

from mtpgo_core.frames import wrap
from mtpgo_core.scene.trails import trail_index
from mtpgo_core.scene.trails.trail_index import _RECENT, CELL_M, PER_CELL, TrailIndex

TOLERANCE_RAD, REACH_M = 0.35, 1.9


def filled(place, heading, at_once):
    index = TrailIndex()
    for begin in range(0, len(place), at_once):
        some = slice(begin, begin + at_once)
        index.add(place[some], heading[some], np.arange(len(place))[some], 0)
    return index


@pytest.mark.parametrize("recent", [0, 100, 10**6])
def test_all_points_within_reach_and_tolerance_are_found(monkeypatch, recent):
    monkeypatch.setattr(trail_index, "_RECENT", recent)
    rng = np.random.default_rng(1)
    place, heading = rng.uniform(-30, 30, (4000, 2)), rng.uniform(-9, 9, 4000)
    index = filled(place, heading, 37)
    wanted, toward = rng.uniform(-30, 30, (80, 2)), rng.uniform(-3, 3, 80)
    row, number = index.find(wanted, toward, REACH_M, TOLERANCE_RAD, 500, 3000)
    found = set(zip(row.tolist(), number.tolist(), strict=True))
    assert len(found) == len(row)
    assert number.min() >= 500
    assert number.max() < 3000
    near = np.linalg.norm(wanted[:, None] - place, axis=-1) < REACH_M
    near &= np.abs(wrap(toward[:, None] - heading)) < TOLERANCE_RAD
    expected = {(i, j) for i, j in np.argwhere(near).tolist() if 500 <= j < 3000}
    assert len(expected) > 50
    assert expected <= found
    assert len(found) < 20 * len(expected)


@pytest.mark.parametrize("recent", [0, 25, 10**6])
def test_of_a_full_cell_the_newest_are_returned(monkeypatch, recent):
    monkeypatch.setattr(trail_index, "_RECENT", recent)
    place = np.full((50, 2), 0.5 * CELL_M)
    index = filled(place, np.full(50, 0.1), 10)
    _, number = index.find(place[:1], np.array([0.1]), 0.4, 0.05, 0, 50)
    assert sorted(number.tolist()) == list(range(50 - PER_CELL, 50))
    _, number = index.find(place[:1], np.array([0.1]), 0.4, 0.05, 3, 12)
    assert sorted(number.tolist()) == list(range(3, 12))


def test_points_that_are_overwritten_leave_the_index(monkeypatch):
    monkeypatch.setattr(trail_index, "_RECENT", 10)
    index = TrailIndex()
    for begin in range(0, 1000, 20):
        number = np.arange(begin, begin + 20)
        index.add(np.zeros((20, 2)), np.zeros(20), number, max(0, begin - 100))
    assert index.nbytes <= 8 * 120


def test_a_reserved_index_finds_the_same_and_keeps_its_size():
    draw = np.random.default_rng(3)
    plain, reserved = TrailIndex(), TrailIndex(reserved=3 * _RECENT)
    size = reserved._long.nbytes
    for number in range(0, 8 * _RECENT, 512):
        place, heading = draw.uniform(-20, 20, (512, 2)), draw.uniform(-3, 3, 512)
        numbers = number + np.arange(512)
        oldest = max(0, number - 3 * _RECENT)
        for index in (plain, reserved):
            index.add(place, heading, numbers, oldest)
        wanted = (place[:20], heading[:20], 1.2, 0.35, oldest, number + 512)
        for given, expected in zip(reserved.find(*wanted), plain.find(*wanted), strict=True):
            np.testing.assert_array_equal(given, expected)
        assert size - 8 * _RECENT * 2 <= reserved._long.nbytes <= size
