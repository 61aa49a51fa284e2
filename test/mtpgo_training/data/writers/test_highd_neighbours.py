# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The eight neighbours of a vehicle: by hand, and against a loop over all pairs."""

import numpy as np

from mtpgo_training.data.writers.highd_neighbours import NEIGHBOURS, neighbours


def found(along, length, lane, vehicle=0):
    """Neighbours of one vehicle by name, without those that it does not have."""
    index = neighbours(np.array(along, float), np.array(length, float), np.array(lane))[vehicle]
    return {name: int(i) for name, i in zip(NEIGHBOURS, index, strict=True) if i >= 0}


def test_the_nearest_vehicles_ahead_and_behind_in_the_same_lane():
    assert found([0, 30, 20, -50, -40], [4] * 5, [1] * 5) == {"preceding": 2, "following": 4}


def test_a_vehicle_in_the_next_lane_is_alongside_where_the_boxes_overlap():
    # Boxes of 4 m and 12 m overlap while the centres are less than 8 m apart.
    assert found([0, 7.9], [4, 12], [1, 2]) == {"leftAlongside": 1}
    assert found([0, 8.0], [4, 12], [1, 2]) == {"leftPreceding": 1}
    assert found([0, -8.0], [4, 12], [1, 0]) == {"rightFollowing": 1}


def test_lanes_further_away_are_not_looked_at():
    assert found([0, 5, -5], [4, 4, 4], [0, 2, 2]) == {}


def test_neighbours_equal_those_of_a_loop_over_all_pairs():
    generator = np.random.default_rng(5)
    along, length = generator.uniform(0, 200, 30), generator.uniform(3, 18, 30)
    lane = generator.integers(0, 3, 30)
    found = neighbours(along, length, lane)
    for i in range(30):
        for column, name in enumerate(NEIGHBOURS):
            want = lane[i] + (1 if name.startswith("left") else -1 if "right" in name else 0)
            best, nearest = -1, np.inf
            for j in range(30):
                if j == i or lane[j] != want:
                    continue
                ahead = along[j] - along[i]
                alongside = want != lane[i] and abs(ahead) < (length[i] + length[j]) / 2
                kind = "Alongside" if alongside else "receding" if ahead > 0 else "ollowing"
                if kind in name and abs(ahead) < nearest:
                    best, nearest = j, abs(ahead)
            assert found[i, column] == best, (i, name)
    assert neighbours(along[:0], length[:0], lane[:0]).shape == (0, 8)
