# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Velocities and headings of another frame or unit are told from those of ordinary trackers."""

import re

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.frames import rotate
from mtpgo_core.history.checks.movement_fit import MovementFit
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig

CONFIG = HistoryConfig()


def found(
    velocity=lambda velocity, yaw: velocity,
    heading=lambda yaw: yaw,
    *,
    agents=12,
    spoilt=None,
    speed_mps=12.0,
    seconds=8,
    directions=2 * np.pi,
    noise_m=0.0,
):
    """Return the two problems of agents that drive straight on, some with changed values.

    Args:
        velocity: from velocity [n, 2] and heading [n] to those of the messages.
        heading: the same of headings.
        spoilt: how many agents have changed values, None for all.
        directions: the agents drive in directions from 0 up to this (rad).
    """
    rng = np.random.default_rng(3)
    yaw = np.arange(agents) / agents * directions
    true = speed_mps * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    given, facing = velocity(true, yaw), heading(yaw)
    good = np.arange(agents) >= (agents if spoilt is None else spoilt)
    given, facing = np.where(good[:, None], true, given), np.where(good, yaw, facing)
    history, fit = TrackHistory(CONFIG), MovementFit()
    start = 100.0 * np.stack([np.arange(agents), np.arange(agents)], axis=1)
    for step in range(10 * seconds):
        position = start + 0.1 * step * true + rng.normal(0.0, noise_m, (agents, 2))
        states = tracked_states(
            1 + step * 10**8, "map", keys_from_integers(range(agents)), position,
            velocity=given, yaw=facing,
        )  # fmt: skip
        history.update(states)
        if step % 10 == 9:
            fit.look(history.window(), CONFIG.dt_s)
    return fit.velocity_problem, fit.heading_problem


@pytest.mark.parametrize(
    ("velocity", "how"),
    [
        (lambda v, yaw: 3.6 * v, r"in 100 % of \d+ comparisons \(3\.6 times as large"),
        (lambda v, yaw: v / 3.6, r"\(0\.28 times as large in the mean\); expected: over ground"),
        (lambda v, yaw: rotate(v, -yaw), r"in [5-9]\d % .*in other directions"),
        (lambda v, yaw: rotate(v, np.full(len(v), np.pi / 2)), "turned by 90 degrees"),
        (lambda v, yaw: 0.0 * v, r"\(nearly zero\)"),
        (lambda v, yaw: v - [10.0, 0.0], "do not fit their movement"),  # relative to an ego
        (lambda v, yaw: v * [1.0, -1.0], "in other directions"),  # y downwards
    ],
    ids=["km/h", "of km/h", "frame of the object", "quarter turn", "zero", "relative", "mirrored"],
)
def test_velocities_that_do_not_fit(velocity, how):
    wrong, heading = found(velocity)
    assert wrong.startswith("the velocities of the road users do not fit their movement in")
    assert re.search(how, wrong), wrong
    assert heading == ""


def test_velocities_in_the_frame_of_objects_that_go_to_and_fro():
    wrong, _ = found(lambda v, yaw: rotate(v, -yaw), agents=2, seconds=30)
    assert "in 50 % of" in wrong
    assert "turned by 180 degrees" in wrong or "turned by -180 degrees" in wrong


@pytest.mark.parametrize(
    ("heading", "how"),
    [
        (lambda yaw: np.pi / 2 - yaw, "in other directions"),  # clockwise from north
        (lambda yaw: yaw + np.pi / 2, "turned by 90 degrees in the mean"),
        (lambda yaw: np.radians(yaw), "expected: radians, counter-clockwise from the x axis"),
        (lambda yaw: yaw + np.pi, "turned by"),
    ],
    ids=["compass", "quarter turn", "degrees twice", "backwards"],
)
def test_headings_that_do_not_fit(heading, how):
    velocity, wrong = found(heading=heading)
    assert velocity == ""
    assert wrong.startswith("the headings of the road users do not fit their movement in")
    assert how in wrong


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"noise_m": 0.3},
        {"velocity": lambda v, yaw: np.full_like(v, np.nan), "noise_m": 0.1},
        {"heading": lambda yaw: np.full_like(yaw, np.nan)},
        {"speed_mps": 0.5, "velocity": lambda v, yaw: 0.0 * v},  # nearly standing
        {"speed_mps": 1.4, "heading": lambda yaw: yaw + 2.0},  # pedestrians look aside
        {"velocity": lambda v, yaw: 3.6 * v, "spoilt": 2},  # two of twelve
        {"velocity": lambda v, yaw: 0.8 * v},  # the lag of a filter
    ],
)
def test_ordinary_sources_fit(settings):
    assert found(**settings) == ("", "")


def problems_of_path(velocity, yaw, position, first=0):
    """Return the two problems of ten agents of one path, samples [T] from ``first`` on."""
    ten = [np.repeat(values[None], 10, axis=0) for values in (position, velocity, yaw)]
    valid = np.broadcast_to(np.arange(len(yaw)) >= first, (10, len(yaw)))
    fit = MovementFit()
    for _ in range(6):
        fit.look(window_of(*ten, valid=valid), CONFIG.dt_s)
    return fit.velocity_problem, fit.heading_problem


def test_only_the_last_second_is_compared():
    """Ten steps to the east at 10 m/s, and then one second, five steps, to the north."""
    north = np.arange(16) >= 10
    velocity = np.where(north[:, None], [0.0, 10.0], [10.0, 0.0])
    position = 2.0 * np.stack(
        [np.minimum(np.arange(16), 10), np.maximum(np.arange(16) - 10, 0)], 1
    )
    yaw = np.where(north, np.pi / 2, 0.0)
    assert problems_of_path(velocity, yaw, position) == ("", "")
    wrong, _ = problems_of_path(3.6 * velocity, yaw, position, first=10)
    assert "3.6 times as large" in wrong  # one second of observations is enough
    assert problems_of_path(3.6 * velocity, yaw, position, first=11) == ("", "")


def test_the_heading_of_a_turn_is_compared_in_its_middle():
    """At 2 rad/s the heading at the end of the second is 1 rad beyond the way travelled."""
    yaw = 2.0 * CONFIG.dt_s * np.arange(16)
    velocity = 8.0 * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    position = 4.0 * np.stack([np.sin(yaw), -np.cos(yaw)], axis=1)  # a circle of 4 m
    assert problems_of_path(velocity, yaw, position)[1] == ""
    assert "turned by" in problems_of_path(velocity, yaw + 1.0, position)[1]


def test_pedestrians_without_velocities_are_noticed():
    assert "nearly zero" in found(lambda v, yaw: 0.0 * v, speed_mps=1.2)[0]


def test_a_few_comparisons_give_no_verdict():
    twisted = {"velocity": lambda v, yaw: 3.6 * v}
    assert found(**twisted, agents=3, seconds=4) == ("", "")
    assert found(**twisted, agents=1, seconds=120)[0] != ""


def test_a_source_that_was_mended_fits_again():
    fit, moved = MovementFit(), np.tile([[10.0, 0.0]], (10, 1))
    for _ in range(60):
        fit.compare(moved, 3.6 * moved, np.zeros(10))
    assert fit.velocity_problem
    for _ in range(60):
        fit.compare(moved, moved, np.zeros(10))
    assert fit.velocity_problem == ""
