# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The features of the ways on: own frame, slow agents, absent agents."""

import dataclasses

import numpy as np
import pytest
from trail_lines import DT_S, along, bend, drive, window_at

from mtpgo_core.frames import rotate
from mtpgo_core.scene.trails.class_groups import MOTOR, floor_mps
from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.scene.trails.trail_memory import TrailMemory

H = 25


def features(memory, window, **options):
    return trail_features(window, TrailContext(memory, H, DT_S, **options))


@pytest.fixture(scope="module")
def bends():
    memory = TrailMemory()
    drive(memory, bend(1), ident=1)
    return memory


def agent(position=(0.0, 0.0), speed=8.0, course=0.0, *, ident=9, yaw=None):
    velocity = speed * np.array([np.cos(course), np.sin(course)])
    return window_at(60.0, [ident], position, velocity, yaw=None if yaw is None else [yaw])


@pytest.mark.parametrize("speed", [5.0, 8.0, 12.0])
def test_a_branch_is_the_line_at_the_distances_of_constant_speed(bends, speed):
    given = features(bends, agent(speed=speed))[0, 0]
    distance = speed * DT_S * np.arange(1, H + 1)
    place, _ = along(bend(1), 40.0 + distance)
    known = distance < 15.0 * np.pi / 2 + 57.0
    np.testing.assert_array_equal(given[:, 2], known.astype(float))
    np.testing.assert_allclose(given[known, 0], (place[:, 0] - distance)[known], atol=0.2)
    np.testing.assert_allclose(given[known, 1], place[known, 1], atol=0.2)
    assert not given[~known].any()


@pytest.mark.parametrize("speed", [0.0, 0.2, 3.9])
def test_a_slow_agent_sees_the_way_at_the_least_speed(bends, speed):
    slow = features(bends, agent(speed=speed, yaw=0.0))
    least = float(floor_mps(np.array([MOTOR]))[0])
    np.testing.assert_array_equal(slow, features(bends, agent(speed=least)))


def test_the_features_do_not_depend_on_the_worlds_axes(bends):
    angle, shift = 2.5, np.array([4e5, -3e5])
    memory = TrailMemory()
    drive(memory, rotate(bend(1), angle) + shift, ident=1)
    place = rotate(np.array([0.4, 0.3]), angle) + shift
    turned = features(memory, agent(place, course=angle + 0.05))
    np.testing.assert_allclose(turned, features(bends, agent((0.4, 0.3), course=0.05)), atol=0.05)


def test_agents_without_heading_or_absent_have_no_ways_on(bends):
    assert features(bends, agent()).any()
    assert not features(bends, agent(speed=0.0, yaw=np.nan)).any()
    window = agent()
    absent = dataclasses.replace(window, valid=np.zeros_like(window.valid))
    assert not features(bends, absent).any()
    assert features(bends, absent).shape == (1, 3, H, 3)


def test_a_memory_that_began_later_does_not_know_what_was_before(bends):
    assert features(bends, agent(), since_ns=0).any()
    assert not features(bends, agent(), since_ns=59_000_000_000).any()
