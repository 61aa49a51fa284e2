# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The arrays that everything is exchanged in."""

import numpy as np
import pytest
from core_helpers import states_of, window_of

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, tracked_states


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("car", AgentClass.CAR),
        (" Truck_Bus ", AgentClass.TRUCK),
        ("cyclist", AgentClass.BICYCLE),
        ("person", AgentClass.PEDESTRIAN),
        ("buses", AgentClass.BUS),
        ("Pedestrians", AgentClass.PEDESTRIAN),
        ("people", AgentClass.PEDESTRIAN),
        ("motorcyclist", AgentClass.MOTORCYCLE),
        ("spaceship", AgentClass.UNKNOWN),
    ],
)
def test_classes_by_name(name, expected):
    assert AgentClass.from_name(name) == expected


def test_what_is_not_given_is_unknown():
    states = tracked_states(5, "map", keys_from_integers([1, 2]), np.zeros((2, 2)))
    assert len(states) == 2
    assert states.agent_class.tolist() == [0, 0]
    for name, shape in (("z", (2,)), ("velocity", (2, 2)), ("covariance", (2, 4, 4))):
        assert getattr(states, name).shape == shape
        assert np.isnan(getattr(states, name)).all()


def test_no_agents_have_arrays_of_the_right_shape():
    states = states_of(0.0, [], [])
    assert (len(states), states.position.shape, states.covariance.shape) == (0, (0, 2), (0, 4, 4))


def test_a_window_is_selected_by_positions_or_by_a_mask():
    position = np.arange(6.0).reshape(3, 1, 2)
    window = window_of(position, np.zeros((3, 1, 2)), np.zeros((3, 1)))
    assert window.select(np.array([2, 0])).position[:, 0, 0].tolist() == [4.0, 0.0]
    masked = window.select(np.array([False, True, False]))
    assert (len(masked), masked.key[0, 0], masked.stamp_ns) == (1, 1, window.stamp_ns)


def test_a_class_by_its_number_in_a_message():
    assert AgentClass.from_code(9) is AgentClass.VAN
    assert AgentClass.from_code(10) is AgentClass.UNKNOWN
    assert AgentClass.from_code(-1) is AgentClass.UNKNOWN
