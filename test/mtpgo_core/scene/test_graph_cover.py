# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Neighbourhoods and covering centres, on lines of agents by hand."""

import numpy as np
import pytest

from mtpgo_core.scene.graph_cover import cover_centres, neighbourhoods
from mtpgo_core.task.task_description import SceneConfig

NONE = np.empty(0, dtype=np.intp)


def line(*x):
    """Agents on the x axis (m)."""
    return np.stack([np.array(x, dtype=float), np.zeros(len(x))], axis=1)


def config(most, radius_m):
    return SceneConfig(max_neighbours=most, radius_m=radius_m)


def test_neighbours_come_by_distance_with_padding_beyond_the_radius():
    members, distance = neighbourhoods(line(0, 10, 25, 100), np.array([1, 3]), 2, 20.0)
    assert members.tolist() == [[1, 0, 2], [3, -1, -1]]
    assert distance.tolist() == [[0, 10, 15], [0, np.inf, np.inf]]


def test_the_number_of_neighbours_is_limited_to_the_nearest():
    members, _ = neighbourhoods(line(0, 10, 25, 26), np.array([0, 2]), 1, 1000.0)
    assert members.tolist() == [[0, 1], [2, 3]]


def test_at_equal_distances_the_order_of_the_agents_decides():
    members, _ = neighbourhoods(line(-5, 0, 5, -5), np.array([1]), 2, 10.0)
    assert members.tolist() == [[1, 0, 2]]


def test_without_neighbours_every_agent_is_alone():
    members, distance = neighbourhoods(line(0, 0, 0), np.arange(3), 0, 10.0)
    assert members.tolist() == [[0], [1], [2]]
    assert distance.tolist() == [[0.0]] * 3


def test_two_separate_groups_need_two_centres():
    position = line(0, 5, 10, 1000, 1005, 1010)
    centre = cover_centres(position, config(31, 50.0), -1, NONE)
    assert sorted(c // 3 for c in centre) == [0, 1]


def test_the_ego_is_the_first_centre_and_covers_what_it_can():
    position = line(0, 5, 10, 1000)
    assert cover_centres(position, config(31, 50.0), 2, NONE).tolist() == [2, 3]


def test_a_previous_centre_is_kept_while_it_is_needed():
    position = line(0, 5, 10, 1000)
    assert cover_centres(position, config(31, 50.0), -1, np.array([2])).tolist() == [2, 3]
    # Of two previous centres with the same agents one is dropped.
    assert cover_centres(position[:3], config(31, 50.0), -1, np.array([2, 0])).shape == (1,)


@pytest.mark.parametrize(("gap_m", "centres"), [(39.0, 1), (41.0, 2)])
def test_a_centre_is_dropped_only_if_the_others_reach_its_agents_well(gap_m, centres):
    # Within 0.8 of 50 m the other centre contains both agents well, beyond only just.
    found = cover_centres(line(0, gap_m), config(31, 50.0), -1, np.array([0, 1]))
    assert found.shape == (centres,)
