# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What becomes part of the memory of trails, and what does not."""

import dataclasses

import numpy as np
import pytest
from trail_lines import DT_S, S_NS, along, bend, drive, window_at

from mtpgo_core.scene.trails.class_groups import MOTOR, PEDESTRIAN, UNKNOWN, spacing_m
from mtpgo_core.scene.trails.trail_index import _RECENT
from mtpgo_core.scene.trails.trail_memory import CAPACITY, SET_BACK_NS, TrailMemory
from mtpgo_core.scene.trails.trail_points import PointColumns
from mtpgo_core.schema import AgentClass

SPACING_M = float(spacing_m(np.array([MOTOR]))[0])


def points_of(memory):
    """Places [p, 2], headings [p] and next points [p] (-1 for none)."""
    number = np.arange(memory.points.oldest, memory.points.count)
    following = memory.points.column("following", number)
    return (
        memory.points.column("offset", number) + memory.origin,
        memory.points.column("heading", number),
        np.where(following > 0, number + following, -1),
    )


@pytest.mark.parametrize(
    ("kind", "group"),
    [
        (AgentClass.CAR, MOTOR),
        (AgentClass.PEDESTRIAN, PEDESTRIAN),
        (AgentClass.UNKNOWN, UNKNOWN),
    ],
)
def test_a_trail_has_points_at_a_fixed_distance_in_the_order_of_travel(kind, group):
    memory = TrailMemory()
    line = bend(1)
    drive(memory, line, ident=3, speed=6.3, kind=kind)
    place, heading, following = points_of(memory)
    spacing = float(spacing_m(np.array([group]))[0])
    step = np.diff(place, axis=0)
    np.testing.assert_allclose(np.hypot(*step.T), spacing, atol=0.06 * spacing)
    np.testing.assert_array_equal(following[:-1], np.arange(1, len(place)))
    assert following[-1] == -1
    assert place[0].tolist() == [-40.0, 0.0]
    assert len(place) == pytest.approx(np.hypot(*np.diff(line, axis=0).T).sum() / spacing, abs=3)
    expected = np.clip(place[:, 0] / 15.0, 0.0, 1.0)  # sine of the course on the arc
    np.testing.assert_allclose(np.sin(heading), expected, atol=0.05)


def test_standing_and_jitter_leave_no_trail():
    memory, rng = TrailMemory(), np.random.default_rng(0)
    for k in range(200):
        place = 5.0 + rng.normal(0.0, 0.3, 2)
        memory.add(window_at(DT_S * k, [1], place, rng.normal(0, 0.4, 2), yaw=[0.3]), DT_S)
    assert len(memory) == 0


def trails_in(memory):
    number = np.arange(memory.points.oldest, memory.points.count)
    return len(set(memory.points.column("trail", number).tolist()))


def test_a_jump_a_pause_or_another_class_starts_a_new_trail():
    for change in ("none", "jump", "aside", "pause", "class", "backwards"):
        memory, late_s = TrailMemory(), 0.0
        for k in range(40):
            place, velocity, kind = [2.0 * k, 0.0], [10.0, 0.0], AgentClass.CAR
            if k >= 20:
                place[0] += 60.0 * (change == "jump")
                place[1] += 6.0 * (change == "aside")
                late_s = 1.5 * (change == "pause")
                kind = AgentClass.PEDESTRIAN if change == "class" else kind
                if change == "backwards":
                    place[0] = 80.0 - 2.0 * k
            memory.add(window_at(DT_S * k + late_s, [1], place, velocity, kind=kind), DT_S)
        if change == "backwards":  # every step contradicts the heading
            assert trails_in(memory) == 1
            assert points_of(memory)[0][:, 0].max() <= 40.0
        else:
            assert trails_in(memory) == 1 + (change != "none"), change


def test_a_cycle_a_second_gives_the_trail_of_five_cycles():
    """What happened between two windows is taken from the past in the later one."""
    line, often, seldom = bend(1), TrailMemory(), TrailMemory()
    for k in range(60):
        times = k - np.arange(15, -1, -1)
        place, course = along(line, 2.0 * np.maximum(times, 0))
        window = window_at(DT_S * k, [7], place[-1], 10.0 * course[-1])
        window = dataclasses.replace(
            window,
            position=place[None],
            velocity=10.0 * course[None],
            yaw=np.arctan2(course[:, 1], course[:, 0])[None],
            valid=(times >= 0)[None],
        )
        often.add(window, DT_S)
        if k % 5 == 4:
            seldom.add(window, DT_S)
    for one, other in zip(points_of(often), points_of(seldom), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


def test_a_window_of_another_frame_or_long_before_starts_a_new_memory():
    for when_s, frame, kept in (
        (100.0, "map", True),
        (100.0, "odom", False),
        (0.0, "map", False),
    ):
        memory = TrailMemory()
        end_s = drive(memory, bend(0), ident=1)
        before = len(memory)
        memory.add(
            window_at(end_s + when_s if when_s else 1.0, [2], [0, 0], [1, 0], frame=frame), DT_S
        )
        assert len(memory) == (before if kept else 0)


def test_a_window_a_little_older_than_the_last_adds_nothing():
    memory = TrailMemory()
    end_s = drive(memory, bend(0), ident=1)
    before = len(memory)
    for back_s in (0.0, 0.1, SET_BACK_NS / S_NS):
        memory.add(window_at(end_s - back_s, [1], [900.0, 0.0], [8.0, 0.0]), DT_S)
    assert len(memory) == before


def test_the_oldest_points_are_overwritten():
    memory = TrailMemory(capacity=100)
    start_s = 0.0
    for ident in range(8):
        start_s = drive(memory, bend(0), ident=ident, start_s=start_s) + 1.0
    place, _, following = points_of(memory)
    assert len(place) == 100
    assert memory.points.count == 8 * 50
    assert (following < memory.points.count).all()
    np.testing.assert_allclose(place[-1], [60.0, 0.0], atol=SPACING_M)


def test_a_full_memory_needs_less_than_fifty_megabytes():
    codes = 8 * (CAPACITY + 2 * _RECENT)
    merging = codes  # the old and the new index exist at once
    assert PointColumns.empty(CAPACITY).nbytes + codes + merging < 50e6


def test_a_road_user_without_heading_leaves_no_trail_until_it_has_one():
    memory = TrailMemory()
    for k in range(40):
        velocity, yaw = ([8.0, 0.0], 0.0) if k >= 20 else ([np.nan, np.nan], np.nan)
        memory.add(window_at(DT_S * k, [2], [1.6 * k, 9.0], velocity, yaw=[yaw]), DT_S)
    place = points_of(memory)[0]
    assert 30.0 < place[0, 0] < 36.0
    assert trails_in(memory) == 1


def test_a_reserved_memory_holds_the_same_in_the_space_taken_at_first():
    plain, reserved = TrailMemory(500), TrailMemory(500, reserved=True)
    space = reserved.points.nbytes
    for memory in (plain, reserved):
        for ident in range(1, 9):
            drive(memory, bend(1), ident=ident, speed=6.3, kind=AgentClass.CAR)
    for given, expected in zip(points_of(reserved), points_of(plain), strict=True):
        np.testing.assert_array_equal(given, expected)
    assert reserved.points.nbytes == space


def test_a_stray_object_far_away_takes_no_precision_from_the_others():
    """Whether it is there first or comes later."""
    line, aside = bend(1), np.array([0.0, 4.0])
    memory = TrailMemory()
    for k in range(60):
        time_s, stray = DT_S * k, [9e7 + 4.0 * k, 9e7]
        ids, places, velocity = [9], [stray], [[20.0, 0.0]]
        if k >= 10:
            place, course = along(line, 1.6 * (k - 10))
            ids = [1, 2, 9]
            places, velocity = [place, place + aside, stray], [8.0 * course, 8.0 * course, [20, 0]]
        memory.add(window_at(time_s, ids, places, velocity), DT_S)
    place, _, _ = points_of(memory)
    reached, _ = along(line, np.arange(0.0, 78.5, 0.05))
    both = np.concatenate([reached, reached + aside])
    apart = np.linalg.norm(place[:, None] - both[None], axis=2).min(axis=1)
    assert len(place) > 60
    assert apart.max() < 0.2


def test_a_vehicle_alone_far_away_leaves_the_memory_of_a_site():
    memory = TrailMemory()
    end_s = drive(memory, bend(1), ident=1)
    before = points_of(memory)[0]
    drive(memory, bend(0) + 9e7, ident=2, start_s=end_s + 1.0)
    np.testing.assert_array_equal(points_of(memory)[0], before)
