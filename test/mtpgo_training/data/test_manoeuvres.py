# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Paths whose manoeuvre is known by construction."""

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.manoeuvres import MANOEUVRES, label, members

DT, H = 0.2, 25
T = np.arange(H + 1) * DT


def straight(speed=15.0):
    return np.stack([speed * T, np.zeros(H + 1)], axis=1)


def lane_change(aside, speed=15.0):
    """A smooth step to the side between 1 and 4 s."""
    share = np.clip((T - 1.0) / 3.0, 0.0, 1.0)
    return np.stack([speed * T, aside * (3 * share**2 - 2 * share**3)], axis=1)


def bend(rate, speed=15.0):
    return speed / rate * np.stack([np.sin(rate * T), 1.0 - np.cos(rate * T)], axis=1)


def braking(deceleration, speed=15.0):
    end = np.minimum(T, speed / deceleration)
    return np.stack([speed * end - 0.5 * deceleration * end**2, np.zeros(H + 1)], axis=1)


def names(path, lanes=(), kind=AgentClass.CAR, turned=0.0, known=None):
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[c, -s], [s, c]])
    path = path @ turn.T + (700.0, -300.0)
    known = np.ones((1, H + 1), bool) if known is None else known
    lanes = [line @ turn.T + (700.0, -300.0) for line in lanes]
    bits = label(path[None], known, DT, np.array([kind], np.uint8), lanes)
    return {name for name in MANOEUVRES if members(bits, name)[0]}


@pytest.mark.parametrize("turned", [0.0, 1.0, 3.0])
@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (straight(), {"lane_keep"}),
        (straight(0.1), {"standing"}),
        (lane_change(3.5), {"change_left"}),
        (lane_change(-3.5), {"change_right"}),
        (lane_change(1.5), {"lane_keep"}),
        (bend(0.05), {"lane_keep"}),  # 14 degrees in 5 s, 9 m aside: still the same lane
        (bend(0.3), {"turning"}),
        (bend(-0.3), {"turning"}),
        (braking(1.0), {"lane_keep", "braking"}),
        (braking(0.5), {"lane_keep"}),
        (braking(6.0), {"lane_keep", "braking"}),  # stands from 2.5 s on
    ],
)
def test_without_markings_the_path_decides(path, expected, turned):
    assert names(path, turned=turned) == expected


def markings(*offsets, backwards=False):
    x = np.linspace(-50.0, 200.0, 6)
    lines = [np.stack([x, np.full(6, y)], axis=1) for y in offsets]
    return [line[::-1] for line in lines] if backwards else lines


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_with_markings_crossings_decide(backwards, turned):
    lanes = markings(1.75, -1.75, backwards=backwards)
    assert names(lane_change(2.0), lanes, turned=turned) == {"change_left"}
    assert names(lane_change(-2.0), lanes, turned=turned) == {"change_right"}
    assert names(lane_change(1.5), lanes, turned=turned) == {"lane_keep"}
    weaving = straight() + np.stack([0.0 * T, 2.0 * np.sin(2 * np.pi * T / 5.0)], axis=1)
    assert names(weaving, lanes, turned=turned) == {"lane_keep"}


def test_the_markings_of_a_crossing_road_do_not_count():
    across = [np.array([[30.0, -50.0], [30.0, 50.0]])]
    assert names(straight(), across) == {"lane_keep"}
    beyond = [np.array([[200.0, 0.5], [300.0, 0.5]])]
    assert names(lane_change(3.5), beyond) == {"lane_keep"}


def test_road_users_that_are_not_vehicles_have_no_lane():
    assert names(straight(1.2), kind=AgentClass.PEDESTRIAN) == set()
    assert names(bend(0.3, 5.0), kind=AgentClass.BICYCLE) == {"turning"}
    assert names(straight(0.0), kind=AgentClass.PEDESTRIAN) == {"standing"}


def test_a_road_user_not_observed_to_the_end_has_no_manoeuvre():
    known = np.ones((1, H + 1), bool)
    known[0, -1] = False
    assert names(straight(), known=known) == set()


def test_there_is_no_braking_over_a_short_horizon():
    path = braking(6.0)[None, :6]
    bits = label(path, np.ones((1, 6), bool), DT, np.array([1], np.uint8))
    assert not members(bits, "braking")[0]
    assert label(path[:0], np.ones((0, 6), bool), DT, np.zeros(0, np.uint8)).shape == (0,)
