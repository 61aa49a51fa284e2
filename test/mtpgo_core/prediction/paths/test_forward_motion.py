# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted vehicles do not reverse."""

import dataclasses

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.prediction.paths.forward_motion import without_reversing
from mtpgo_core.schema import AgentClass, Prediction

H, DT = 25, 0.2
TIME = DT * np.arange(1, H + 1)


def braking(agent_class=AgentClass.CAR, speed=4.0, heading=0.7):
    """Two modes: braking at 2 m/s^2 beyond the standstill, and driving on."""
    ahead = np.array([np.cos(heading), np.sin(heading)])
    along = np.stack([speed * TIME - TIME**2, speed * TIME])
    velocity = np.stack([speed - 2.0 * TIME, np.full(H, speed)])
    mean = np.concatenate([along[..., None] * ahead, velocity[..., None] * ahead], axis=-1)
    return Prediction(
        stamp_ns=0,
        frame_id="map",
        key=np.zeros((1, 4), np.uint32),
        agent_class=np.array([agent_class], np.uint8),
        z=np.zeros(1),
        size=np.full((1, 2), 2.0),
        initial=np.concatenate([np.zeros(2), speed * ahead])[None],
        initial_yaw=np.array([heading]),
        time_s=TIME,
        weight=np.array([[0.6, 0.4]]),
        mean=mean[None],
        yaw=np.where(velocity < 0.0, heading + np.pi, heading)[None],
        covariance=np.broadcast_to(np.eye(2), (1, 2, H, 2, 2)).copy(),
        source=np.zeros(1, np.uint8),
    )


def history(given, *, before_mps=None, length_m=np.nan):
    """The window of a prediction: uniform motion until t, at other speeds before if given."""
    speed = np.linalg.norm(given.initial[0, 2:])
    speeds = np.array([*(before_mps or [speed] * 15), speed])
    ahead = given.initial[0, 2:] / speed
    return dataclasses.replace(
        window_of(
            (np.cumsum(DT * speeds) - DT * speeds.sum())[None, :, None] * ahead,
            speeds[None, :, None] * ahead,
            np.full((1, len(speeds)), given.initial_yaw[0]),
            size=np.array([[length_m, 2.0]]),
        ),
        agent_class=given.agent_class,
    )


def served(given, **past):
    return without_reversing(given, history(given, **past))


def test_a_path_that_turns_back_stops_where_it_does():
    given = braking()
    result = served(given)
    stop = np.linalg.norm(result.mean[0, 0, -1, :2])
    assert stop == pytest.approx(4.0, abs=0.02)  # v^2 / (2 a)
    assert (np.diff(np.linalg.norm(result.mean[0, 0, :, :2], axis=-1)) >= 0.0).all()
    np.testing.assert_array_equal(result.mean[0, 0, 11:, 2:], 0.0)
    np.testing.assert_allclose(result.yaw[0, 0], 0.7)
    np.testing.assert_array_equal(result.mean[0, 1], given.mean[0, 1])
    np.testing.assert_array_equal(result.covariance, given.covariance)


def test_of_two_vehicles_only_the_one_that_turns_back_is_changed():
    good, bad = braking(heading=2.0), braking()
    good.mean[0, 0] = good.mean[0, 1]
    names = [f.name for f in dataclasses.fields(Prediction)]
    rows = [n for n in names if n not in ("stamp_ns", "frame_id", "time_s")]
    both = {n: np.concatenate([getattr(good, n), getattr(bad, n)]) for n in rows}
    given = dataclasses.replace(good, **both)
    ahead = given.initial[:, None, 2:].repeat(16, axis=1)
    past = window_of(np.zeros((2, 16, 2)), ahead, np.zeros((2, 16)))
    result = without_reversing(given, dataclasses.replace(past, agent_class=given.agent_class))
    np.testing.assert_array_equal(result.mean[0], given.mean[0])
    np.testing.assert_array_equal(result.mean[1], served(bad).mean[0])


def test_a_path_that_reverses_from_the_start_stays_at_the_start():
    given = braking()
    given.mean[0, 0, :, :2] *= -1.0
    result = served(given)
    np.testing.assert_array_equal(result.mean[0, 0], 0.0)


@pytest.mark.parametrize(
    ("agent_class", "speed", "changes"),
    [
        (AgentClass.PEDESTRIAN, 1.0, False),
        (AgentClass.UNKNOWN, 1.0, False),
        (AgentClass.UNKNOWN, 8.0, True),
        (AgentClass.BICYCLE, 3.0, True),
        (AgentClass.CAR, 0.3, False),  # stands
    ],
)
def test_only_moving_vehicles_are_changed(agent_class, speed, changes):
    given = braking(agent_class, speed)
    assert (served(given) is not given) == changes


@pytest.mark.parametrize(
    ("before_mps", "length_m", "changes"),
    [
        ([1.0] * 15, 3.4, True),  # as long as a car
        ([1.0] * 15, 0.6, False),
        ([1.0] * 15, np.nan, False),
        ([5.0] * 5 + [2.0] * 10, np.nan, True),  # braked
        ([1.0] * 6 + [5.0] * 2 + [1.0] * 7, np.nan, False),  # noise of a tracker
        ([5.0], np.nan, False),  # seen twice
        ([5.0] * 3, np.nan, True),
    ],
)
def test_a_slow_road_user_of_unknown_class_is_a_vehicle_if_long_or_fast_before(
    before_mps, length_m, changes
):
    given = braking(AgentClass.UNKNOWN, 1.4)
    assert (served(given, before_mps=before_mps, length_m=length_m) is not given) == changes


def test_a_tight_turn_is_not_a_reversal():
    given = braking(speed=5.0, heading=0.0)
    angle = np.linspace(0.0, np.pi, H + 1)[1:]  # a U-turn of 8 m
    given.mean[0, :, :, :2] = 8.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    assert served(given) is given


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("radius", [0.25, 0.5, 0.8])
def test_turning_on_the_spot_is_a_reversal_however_slowly(radius, turn):
    """No step of these paths leads against the one before."""
    given = braking(speed=1.0, heading=0.0)
    angle = np.minimum(0.6 * TIME / radius, np.pi)
    after = np.maximum(0.6 * TIME - np.pi * radius, 0.0)
    circle = radius * np.stack([np.sin(angle), turn * (1.0 - np.cos(angle))], axis=-1)
    given.mean[0, :, :, :2] = circle - after[:, None] * [1.0, 0.0]
    result = served(given)
    assert result.mean[0, 0, -1, 0] > given.mean[0, 0, -1, 0] + 0.1
    course = np.diff(result.mean[0, 0, :, :2], axis=0)
    turned = np.abs(np.arctan2(course[:, 1], course[:, 0]))
    assert turned[np.linalg.norm(course, axis=1) > 0.0].max() < np.radians(160.0)


def test_a_turn_that_a_bicycle_can_ride_is_kept():
    given = braking(AgentClass.BICYCLE, speed=2.0, heading=0.0)
    angle = np.minimum(2.0 * TIME / 1.5, np.pi)
    given.mean[0, :, :, :2] = 1.5 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    assert served(given) is given
