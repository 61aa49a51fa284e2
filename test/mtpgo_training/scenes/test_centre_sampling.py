# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Centres of graphs on positions whose covers, sizes and chances are known by hand."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars, cut_windows

from mtpgo_core.schema import AgentClass
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.centre_sampling import (
    Candidates,
    centre_chances,
    copies,
    draw_cover,
    graph_sizes,
    standing,
)

RATE = 10.0


def candidates(*x, chance=None, index=None):
    """Agents on the x axis (m)."""
    n = len(x)
    return Candidates(
        index=np.arange(n) if index is None else np.array(index),
        position=np.stack([np.array(x, dtype=float), np.zeros(n)], axis=1),
        chance=np.ones(n) if chance is None else np.array(chance, dtype=float),
        changes=np.empty(0, dtype=np.int8),
    )


def covers(given, scene, draws=40):
    """The different sets of centres in some draws."""
    drawn = [
        draw_cover(given, scene, np.random.default_rng(seed)).tolist() for seed in range(draws)
    ]
    assert all(len(set(centres)) == len(centres) for centres in drawn)
    return {frozenset(centres) for centres in drawn}


def test_centres_cover_every_agent_and_differ_between_draws():
    # Of three agents in a row the middle one covers all, and each end covers the middle one.
    scene = SceneConfig(radius_m=10.0, max_neighbours=5)
    assert covers(candidates(0.0, 10.0, 20.0), scene) == {frozenset({1}), frozenset({0, 2})}


def test_an_agent_beyond_the_radius_or_the_number_of_neighbours_is_not_covered():
    scene = SceneConfig(radius_m=9.0, max_neighbours=5)
    assert covers(candidates(0.0, 10.0), scene) == {frozenset({0, 1})}
    # One neighbour: 0 and 1 cover each other; 2 covers 1, but neither covers 2.
    scene = SceneConfig(radius_m=100.0, max_neighbours=1)
    assert covers(candidates(0.0, 1.0, 3.0), scene) == {
        frozenset({0, 2}),
        frozenset({1, 2}),
    }


def test_an_agent_without_a_chance_is_no_centre_and_needs_no_cover():
    scene = SceneConfig(radius_m=1.0)
    assert covers(candidates(0.0, 50.0, chance=[0.0, 1.0]), scene) == {frozenset({1})}
    drawn = [
        len(draw_cover(candidates(0.0, chance=[0.25]), scene, np.random.default_rng(seed)))
        for seed in range(400)
    ]
    assert np.mean(drawn) == pytest.approx(0.25, abs=0.07)


def test_centres_are_rows_of_the_window():
    scene = SceneConfig(radius_m=1.0)
    assert covers(candidates(0.0, 50.0, index=[3, 7]), scene) == {frozenset({3, 7})}
    assert draw_cover(candidates(), scene, np.random.default_rng(0)).tolist() == []


def test_the_size_of_a_graph_is_limited_by_radius_and_number():
    given = candidates(0.0, 5.0, 9.0, 30.0, index=[2, 4, 6, 8])
    centres = np.array([8, 2, 6])
    scene = SceneConfig(radius_m=6.0, max_neighbours=9)
    assert graph_sizes(given, centres, scene).tolist() == [1, 2, 2]
    scene = SceneConfig(radius_m=30.0, max_neighbours=9)
    assert graph_sizes(given, centres, scene).tolist() == [4, 4, 4]
    assert graph_sizes(given, centres, dataclasses.replace(scene, max_neighbours=1)).tolist() == [
        2,
        2,
        2,
    ]


@pytest.mark.parametrize(
    ("speed", "moved", "known", "stands"),
    [
        (0.29, 0.49, True, True),
        (0.31, 0.0, True, False),
        (0.0, 0.51, True, False),
        (0.0, 9.0, False, True),  # what was not observed does not count
    ],
)
def test_a_standing_agent_is_slow_and_stays(speed, moved, known, stands):
    features = np.zeros((1, 16, 4), dtype=np.float32)
    features[0, -1] = (20.0, 5.0, 0.0, speed)
    target = np.zeros((1, 3, 4))
    target[0, :, :2] = (20.0, 5.0)
    target[0, 1, 1] += moved
    assert standing(features, target, np.full((1, 3), known)).tolist() == [stands]


def traffic():
    """A car that stands, one at 10 m/s, and a cyclist at 5 m/s who is seen for 3 s of 9 s."""
    plain = braking_cars(tracks=3, seconds=9.0, rate=RATE)
    plain = dataclasses.replace(
        plain, agent_class=np.array([AgentClass.CAR, AgentClass.CAR, AgentClass.BICYCLE], np.uint8)
    )
    speed = np.array([0.0, 10.0, 5.0])[plain.track]
    zero = np.zeros(len(plain))
    moving = dataclasses.replace(
        plain,
        position=np.stack([speed * plain.frame / RATE, 20.0 * plain.track], axis=1),
        velocity=np.stack([speed, zero], axis=1),
        yaw=zero,
    )
    return moving.select_rows((moving.track < 2) | (moving.frame <= 30))


def chances(recording: Recording, **data):
    """Chance by track and time (s) of windows every second."""
    history = HistoryConfig()
    windows = cut_windows(recording, history, 1.0)
    found = centre_chances(windows, recording, FutureTable(recording), DataConfig(**data), 0.2)
    instants = windows.instants
    time_s = (instants.stamp_ns - recording.start_time_ns) // 10**9
    return {
        (int(track), int(time_s[w])): float(chance)
        for track, w, chance in zip(instants.track, instants.window, found, strict=True)
    }


def test_every_agent_may_be_a_centre_by_default():
    assert set(chances(traffic()).values()) == {1.0}


def test_a_standing_agent_is_a_centre_by_its_weight():
    found = chances(traffic(), standing_chance=0.25)
    # In the last window no future shows whether it goes on standing: its speed decides alone.
    assert {found[0, time] for time in range(2, 9)} == {0.25}
    assert {found[1, time] for time in range(2, 9)} == {1.0}


def test_an_agent_whose_future_is_too_short_is_no_centre():
    found = chances(traffic(), min_future_s=2.0)
    assert [found[2, time] for time in range(2, 4)] == [0.0, 0.0]
    assert found[1, 6] == 1.0  # observed until 8.9 s
    assert found[1, 7] == 0.0


def test_only_the_classes_asked_for_are_centres():
    found = chances(traffic(), centre_classes=("bicycle",))
    assert {track: chance for (track, _), chance in found.items()} == {0: 0.0, 1: 0.0, 2: 1.0}


def test_a_weight_is_the_average_number_of_copies():
    rng = np.random.default_rng(1)
    assert [copies(weight, rng) for weight in (0.0, 1.0, 3.0)] == [0, 1, 3]
    drawn = [copies(2.3, rng) for _ in range(2000)]
    assert set(drawn) == {2, 3}
    assert np.mean(drawn) == pytest.approx(2.3, abs=0.04)
