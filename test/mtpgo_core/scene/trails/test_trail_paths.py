# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The paths of earlier road users from a place on, against the lines that they drove."""

import numpy as np
import pytest
from trail_lines import DT_S, S_NS, along, bend, drive, window_at

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.scene.trails.class_groups import class_groups
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.scene.trails.trail_paths import (
    ACROSS_M,
    CANDIDATES,
    FADE_S,
    HEADING_RAD,
    MERGE_M,
    SETTLED_S,
    Places,
    trail_paths,
)
from mtpgo_core.schema import AgentClass

DISTANCE_M = np.arange(1.0, 41.0)
LATER_S = 60.0
ACCURACY_M = 0.2
"""Points two metres apart cut the corners of a bend of 15 m."""


def asked(memory, position=(0.0, 0.0), *, ident=99, heading=0.0, kind=AgentClass.CAR, **options):
    """Paths of one agent: ahead [H, C], left [H, C], reach [C], weight [C]."""
    places = Places(
        key=keys_from_integers([ident]),
        group=class_groups(np.array([kind], dtype=np.uint8)),
        position=np.array([position], dtype=float),
        heading=np.array([heading], dtype=float),
    )
    time_ns = round(options.pop("time_s", LATER_S) * S_NS)
    found = trail_paths(memory, places, time_ns, DISTANCE_M[None], **options)
    return found.ahead[:, 0], found.left[:, 0], found.reach[0], found.weight[0]


def remembered(turn=1, **options):
    memory = TrailMemory()
    drive(memory, bend(turn), ident=1, **options)
    return memory


@pytest.mark.parametrize("turn", [1, 0, -1])
@pytest.mark.parametrize("start", [0.0, 0.3, 1.0, 1.7])
def test_on_a_trail_the_path_is_the_line_that_was_driven(turn, start):
    ahead, left, reach, weight = asked(
        remembered(turn), (start, 0.0) if turn == 0 else (-start, 0)
    )
    place, _ = along(bend(turn), 40.0 + DISTANCE_M + (start if turn == 0 else -start))
    expected = place - ([start, 0.0] if turn == 0 else [-start, 0.0])
    assert reach[0] == len(DISTANCE_M)
    assert weight[0] > 0.3
    assert not weight[1:].any()
    np.testing.assert_allclose(ahead[:, 0], expected[:, 0], atol=ACCURACY_M)
    np.testing.assert_allclose(left[:, 0], expected[:, 1], atol=ACCURACY_M)


def test_the_path_is_in_the_agents_frame():
    memory, angle = TrailMemory(), 2.0
    c, s = np.cos(angle), np.sin(angle)
    drive(memory, bend(1) @ np.array([[c, s], [-s, c]]) + [700.0, -300.0], ident=1)
    turned = asked(memory, (700.0, -300.0), heading=angle)
    for one, other in zip(turned, asked(remembered(1)), strict=True):
        np.testing.assert_allclose(one, other, atol=0.06)


@pytest.mark.parametrize("aside", [1.0, -0.7])
def test_beside_a_trail_the_path_moves_over_to_it(aside):
    ahead, left, reach, _ = asked(remembered(0), (0.0, aside))
    assert reach[0] == len(DISTANCE_M)
    np.testing.assert_allclose(ahead[:, 0], DISTANCE_M, atol=0.02)
    assert left[-1, 0] == pytest.approx(-aside, abs=0.01)
    at_half = left[DISTANCE_M == MERGE_M / 2.0, 0]
    assert at_half == pytest.approx(-aside / 2.0, abs=0.01)
    assert abs(left[0, 0]) < 0.1


@pytest.mark.parametrize(
    ("options", "there"),
    [
        ({}, True),
        ({"position": (0.0, 0.95 * ACROSS_M)}, True),
        ({"position": (0.0, 1.05 * ACROSS_M)}, False),
        ({"heading": 0.95 * HEADING_RAD}, True),
        ({"heading": -1.05 * HEADING_RAD}, False),
        ({"heading": np.pi}, False),
        ({"heading": np.nan}, False),
        ({"ident": 1}, False),
        ({"kind": AgentClass.TRUCK}, True),
        ({"kind": AgentClass.PEDESTRIAN}, False),
        ({"kind": AgentClass.UNKNOWN}, True),
        ({"time_s": 6.0}, True),
        ({"time_s": 4.0}, False),
        ({"since_ns": 4 * S_NS}, True),
        ({"since_ns": 6 * S_NS}, False),
        ({"time_s": 3600.0}, False),
    ],
)
def test_which_trails_pass_an_agent(options, there):
    # The road user drove straight on and was at the place after 5 s.
    assert (asked(remembered(0), **options)[3] > 0.0).any() == there


def test_a_trail_of_unknown_class_serves_everybody():
    memory = remembered(0, kind=AgentClass.UNKNOWN)
    for kind in (AgentClass.CAR, AgentClass.BICYCLE, AgentClass.PEDESTRIAN):
        assert asked(memory, kind=kind)[3][0] > 0.0


def test_only_what_was_known_at_the_time_is_used():
    """A road user ahead that the agent follows: its way is known up to where it is."""
    memory = remembered(0)
    for time_s, known_m in ((5.4, 3), (6.0, 7), (7.0, 15)):
        *_, reach, _ = asked(memory, time_s=time_s)
        assert reach[0] == pytest.approx(known_m, abs=2)
        start = TrailMemory()
        line = bend(0)
        line[1, 0] = 8.0 * time_s - 40.0
        drive(start, line, ident=1)
        for one, other in zip(
            asked(memory, time_s=time_s), asked(start, time_s=time_s), strict=True
        ):
            np.testing.assert_array_equal(one, other)


def test_the_latest_trails_are_used_and_weigh_more():
    memory, start_s = TrailMemory(), 0.0
    for ident in range(CANDIDATES + 5):
        start_s = drive(memory, bend(0), ident=ident, start_s=start_s, speed=20.0) + 2.0
    start_s += SETTLED_S
    _, _, reach, weight = asked(memory, time_s=start_s)
    assert (reach == len(DISTANCE_M)).all()
    period_s = (start_s - SETTLED_S) / (CANDIDATES + 5)
    np.testing.assert_allclose(weight[1:] / weight[:-1], np.exp(-period_s / FADE_S), rtol=1e-3)


def test_trails_that_have_settled_go_before_those_right_ahead():
    memory, start_s = TrailMemory(), 0.0
    for ident in range(3):
        start_s = drive(memory, bend(0), ident=ident, start_s=start_s, speed=20.0)
    ids = range(3, 3 + 8)  # they passed the place in the last seconds and are right ahead
    for k in range(8):
        place = np.stack([np.full(8, 1.6 * k - 6.0), 0.02 * np.arange(8)], axis=1)
        velocity = np.full((8, 2), [8.0, 0.0])
        memory.add(window_at(start_s + DT_S * (k + 1), ids, place, velocity), DT_S)
    time_s = start_s + SETTLED_S
    _, _, reach, weight = asked(memory, time_s=time_s)
    assert reach[:3].tolist() == [len(DISTANCE_M)] * 3
    assert (reach[3:] < 10).all()
    assert (weight > 0.0).sum() == 3 + 8


def test_trails_nearer_in_place_and_direction_weigh_more():
    near, far, askew = (
        asked(remembered(0), (0.0, y), heading=h)[3][0]
        for y, h in ((0.1, 0.0), (0.8, 0.0), (0.1, 0.2))
    )
    assert near > far > 0.0
    assert near > askew > 0.0


def test_an_agent_that_comes_by_twice_follows_its_latest_pass():
    memory = TrailMemory()
    angle = np.linspace(0.0, 5.0 * np.pi, 500)
    ring = 20.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    drive(memory, ring, ident=1)
    ahead, left, reach, weight = asked(memory)
    assert (weight > 0.0).sum() == 1
    # It went on for half a round, 63 m.
    assert reach[0] == len(DISTANCE_M)
    np.testing.assert_allclose(ahead[:, 0], 20.0 * np.sin(DISTANCE_M / 20.0), atol=0.4)
    np.testing.assert_allclose(left[:, 0], 20.0 * (1.0 - np.cos(DISTANCE_M / 20.0)), atol=0.4)


def test_an_empty_memory_and_no_agents_give_nothing():
    assert not asked(TrailMemory())[3].any()
    nobody = Places(keys_from_integers([]), np.zeros(0, np.uint8), np.zeros((0, 2)), np.zeros(0))
    found = trail_paths(remembered(0), nobody, S_NS, np.zeros((0, 40)))
    assert found.ahead.shape == (40, 0, CANDIDATES)


def test_a_cycle_takes_what_a_brute_force_search_finds():
    """Many trails: the same as following each stored trail by a loop."""
    memory, rng = TrailMemory(), np.random.default_rng(3)
    start_s = 0.0
    for ident in range(12):
        line = bend(int(rng.integers(-1, 2)))
        start_s = drive(
            memory, line, ident=ident, start_s=start_s, aside_m=float(rng.normal(0, 0.4))
        )
    ahead, left, reach, weight = asked(memory, (-3.0, 0.2), time_s=start_s)
    number = np.arange(memory.points.count)
    place = memory.points.column("offset", number) + memory.origin
    trail = memory.points.column("trail", number)
    expected = []
    for one in np.unique(trail)[::-1]:
        line = place[trail == one].astype(float)
        nearest = np.linalg.norm(line - [-3.0, 0.2], axis=1).argmin()
        if abs(line[nearest, 1] - 0.2) < ACROSS_M:
            reach_m = 2.0 * np.arange(len(line))
            here = np.interp(-3.0, line[: nearest + 2, 0], reach_m[: nearest + 2])
            expected.append([np.interp(here + 25.0, reach_m, line[:, i]) for i in (0, 1)])
    assert (weight > 0.0).sum() == len(expected)
    found = np.stack([ahead[24] - 3.0, left[24] + 0.2], axis=-1)[: len(expected)]
    np.testing.assert_allclose(found, expected, atol=ACCURACY_M)
    assert (reach[: len(expected)] == 40).all()
