# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The window against a slow, obvious implementation, and by hand-worked numbers."""

import dataclasses
import math

import numpy as np
import pytest
from core_helpers import S_NS, states_of

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import key_to_int, keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig

PLAIN = HistoryConfig(acceleration_source="message")
TOLERANCE_NS = 1000


def mix_angles(a, b, f):
    turn = math.remainder(b - a, 2 * math.pi)
    return math.remainder(a + f * turn, 2 * math.pi)


def sample_at(track, grid_ns, newest, config):
    """What the rules say of one agent at one grid time: (x, y, vx, vy, ax, ay, yaw) or None.

    ``track`` is a list of (stamp_ns, seven numbers); ``newest``: the grid time is the common time.
    """
    past = [s for s in track if s[0] <= grid_ns + TOLERANCE_NS]
    future = [s for s in track if s[0] > grid_ns + TOLERANCE_NS]
    if not past:
        return None
    last_ns, last = past[-1]
    since_ns = grid_ns - last_ns
    if since_ns <= TOLERANCE_NS:
        return list(last)
    if newest:
        if since_ns > config.max_extrapolation_s * S_NS:
            return None
        moved = [last[0] + last[2] * since_ns / S_NS, last[1] + last[3] * since_ns / S_NS]
        return moved + list(last[2:])
    if not future:
        return None
    next_ns, following = future[0]
    if next_ns - last_ns > config.max_gap_s * S_NS + TOLERANCE_NS:
        return None
    f = since_ns / (next_ns - last_ns)
    mixed = [a + f * (b - a) for a, b in zip(last[:6], following[:6], strict=True)]
    return [*mixed, mix_angles(last[6], following[6], f)]


def expected_window(tracks, stamp_ns, config):
    """{id: [T] of sample or None} of all agents that have any."""
    dt_ns = round(config.dt_s * S_NS)
    result = {}
    for agent, track in tracks.items():
        seen = [s for s in track if s[0] <= stamp_ns]
        row = [
            sample_at(seen, stamp_ns - back * dt_ns, back == 0, config)
            for back in range(config.steps - 1, -1, -1)
        ]
        if any(s is not None for s in row):
            result[agent] = row
    return result


def check(window, expected):
    assert [key_to_int(k) for k in window.key] == sorted(expected)
    columns = [window.position, window.velocity, window.acceleration, window.yaw[..., None]]
    given = np.concatenate(columns, axis=2)
    for i, agent in enumerate(sorted(expected)):
        for step, truth in enumerate(expected[agent]):
            assert window.valid[i, step] == (truth is not None), (agent, step)
            if truth is None:
                assert np.isnan(given[i, step]).all()
                continue
            np.testing.assert_allclose(given[i, step, :6], truth[:6], rtol=0, atol=1e-7)
            assert math.remainder(given[i, step, 6] - truth[6], 2 * math.pi) == pytest.approx(
                0.0, abs=1e-9
            )
            assert -math.pi < given[i, step, 6] <= math.pi


@pytest.mark.parametrize(
    ("rate_hz", "jitter_s", "loss", "seed"),
    [
        (5.0, 0.0, 0.0, 0),
        (10.0, 0.03, 0.2, 1),
        (25.0, 0.015, 0.5, 2),
        (100.0, 0.002, 0.6, 3),
        (13.7, 0.02, 0.8, 4),
        (7.3, 0.05, 0.5, 5),
    ],
)
def test_window_equals_the_obvious_implementation(rate_hz, jitter_s, loss, seed):
    draw = np.random.default_rng(seed)
    config = dataclasses.replace(PLAIN, max_gap_s=0.45)
    history = TrackHistory(config)
    agents = 7
    start = draw.uniform(-1e3, 1e3, (agents, 2)) + 4e5
    velocity = draw.uniform(-15, 15, (agents, 2))
    spin = draw.uniform(-3, 3, agents)
    tracks = {i: [] for i in range(agents)}
    stamp_s, checks = 1.7e9, 0
    for k in range(round(8.0 * rate_hz)):
        stamp_ns = round((stamp_s + k / rate_hz + draw.uniform(-jitter_s, jitter_s)) * S_NS)
        t = k / rate_hz
        present = np.flatnonzero((draw.random(agents) > loss) & (t > np.arange(agents) * 0.4))
        draw.shuffle(present)
        wobble = 0.3 * np.sin(3.0 * t + np.arange(agents))[:, None]
        states = tracked_states(
            stamp_ns,
            "map",
            keys_from_integers(present),
            (start + velocity * t + wobble)[present],
            velocity=(velocity + wobble)[present],
            acceleration=np.tile([wobble[0, 0], t], (len(present), 1)),
            yaw=np.pi * np.sin(spin * t)[present],
        )
        report = history.update(states)
        assert report.accepted == len(present)
        for row, agent in enumerate(present):
            numbers = [
                *states.position[row],
                *states.velocity[row],
                *states.acceleration[row],
                states.yaw[row],
            ]
            tracks[agent].append((stamp_ns, numbers))
        if k % 9 == 8 or rate_hz < 8.0:
            check(history.window(), expected_window(tracks, stamp_ns, config))
            asked = stamp_ns + int(draw.integers(-400_000_000, 300_000_000))
            check(history.window(asked), expected_window(tracks, asked, config))
            checks += 1
    assert checks > 5


@pytest.mark.parametrize("rate_hz", [5, 10, 25, 50])
def test_observations_on_the_grid_come_back_exactly(rate_hz):
    draw = np.random.default_rng(rate_hz)
    history, sent = TrackHistory(PLAIN), {}
    for k in range(4 * rate_hz + 1):
        stamp_ns = 1_700_000_000 * S_NS + k * S_NS // rate_hz
        position = np.array([[500_000.0 + 3.0 * k / rate_hz, 17.0]]) + draw.normal(size=2) * 0.1
        sent[stamp_ns] = position[0]
        history.update(
            tracked_states(stamp_ns, "map", keys_from_integers([9]), position, velocity=[[3.0, 0]])
        )
    window = history.window()
    grid = [stamp_ns - back * S_NS // 5 for back in range(15, -1, -1)]
    assert window.valid.all()
    np.testing.assert_array_equal(window.position[0], [sent[g] for g in grid])


def test_message_order_and_slots_do_not_matter():
    draw = np.random.default_rng(0)
    histories = [TrackHistory(HistoryConfig()) for _ in range(2)]
    ids = draw.choice(10_000, 40, replace=False)
    start = draw.uniform(-100, 100, (40, 2))
    histories[1].update(states_of(0.0, [77], [[0.0, 0.0]]))  # shifts all slots of the second
    for k in range(1, 30):
        position = start + 0.5 * k
        for history in histories:
            order = draw.permutation(40)
            history.update(states_of(0.1 * k, ids[order], position[order]))
    first, second = (h.window() for h in histories)
    kept = np.array([key_to_int(k) != 77 for k in second.key])
    for name in ("key", "position", "velocity", "acceleration", "yaw", "valid"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name)[kept])


def test_missing_velocity_is_estimated_and_taken_back_to_the_first_sample():
    history = TrackHistory(HistoryConfig())
    for k in range(16):
        history.update(states_of(0.2 * k, [1], [[2.0 * k, -1.0 * k]]))
    window = history.window()
    np.testing.assert_allclose(window.velocity[0], np.tile([10.0, -5.0], (16, 1)), atol=1e-9)
    np.testing.assert_allclose(window.acceleration[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(window.yaw[0], math.atan2(-5.0, 10.0), atol=1e-12)


def test_estimated_overrules_the_message_only_when_configured():
    for source, expected in (("message", [7.0, 0.0]), ("estimated", [10.0, 0.0])):
        history = TrackHistory(HistoryConfig(velocity_source=source))
        for k in range(10):
            history.update(states_of(0.1 * k, [1], [[float(k), 0.0]], velocity=[[7.0, 0.0]]))
        np.testing.assert_allclose(history.window().velocity[0, -1], expected, atol=1e-9)


def test_acceleration_of_steady_braking_is_found():
    history = TrackHistory(HistoryConfig())
    for k in range(101):
        t = 0.04 * k
        history.update(states_of(t, [1], [[20 * t - t * t, 0.0]], velocity=[[20 - 2 * t, 0.0]]))
    assert history.window().acceleration[0, -1, 0] == pytest.approx(-2.0, abs=0.05)


def test_a_single_observation_without_velocity_stays_unknown():
    history = TrackHistory(HistoryConfig())
    history.update(states_of(1.0, [1], [[3.0, 4.0]]))
    window = history.window()
    assert window.valid[0].tolist() == [False] * 15 + [True]
    assert window.position[0, -1].tolist() == [3.0, 4.0]
    assert np.isnan(window.velocity[0, -1]).all()
    assert np.isnan(window.yaw[0, -1])


def test_yaw_comes_from_the_message_then_the_motion_then_the_past():
    history = TrackHistory(HistoryConfig())
    history.update(states_of(0.0, [1], [[0, 0]], velocity=[[0.0, 2.0]], yaw=[1.0]))
    history.update(states_of(0.2, [1], [[0, 0.4]], velocity=[[0.0, 2.0]]))
    history.update(states_of(0.4, [1], [[0, 0.4]], velocity=[[0.1, 0.0]]))
    history.update(states_of(0.6, [1], [[0, 0.4]], velocity=[[0.1, 0.0]], yaw=[math.pi + 0.5]))
    yaw = history.window().yaw[0, -4:]
    np.testing.assert_allclose(yaw, [1.0, math.pi / 2, math.pi / 2, -math.pi + 0.5], atol=1e-12)


def test_the_tracker_covariance_is_carried_to_the_common_time():
    history = TrackHistory(HistoryConfig())
    covariance = np.diag([1.0, 2.0, 0.5, 0.25])
    history.update(
        states_of(0.0, [1], [[0, 0]], velocity=[[1.0, 0.0]], covariance=covariance[None])
    )
    np.testing.assert_array_equal(history.window().covariance[0], covariance)
    history.update(states_of(0.4, [2], [[5, 5]]))
    carried = history.window().covariance
    np.testing.assert_allclose(carried[0, 0, [0, 2]], [1.0 + 0.16 * 0.5, 0.4 * 0.5])
    assert carried[0, 1, 1] == pytest.approx(2.0 + 0.16 * 0.25)
    assert np.isnan(carried[1]).all()


def test_attributes_are_the_last_known_ones():
    history = TrackHistory(HistoryConfig())
    history.update(
        states_of(0.0, [1], [[0, 0]], z=[2.0], size=[[4.0, 2.0]], agent_class=np.uint8([1]))
    )
    history.update(states_of(0.1, [1], [[0, 0]], size=[[np.nan, 2.5]]))
    window = history.window()
    assert (window.agent_class[0], window.z[0]) == (1, 2.0)
    assert window.size[0].tolist() == [4.0, 2.5]


@pytest.mark.parametrize(
    "config",
    [
        HistoryConfig(steps=1),
        HistoryConfig(max_gap_s=0.0),
        HistoryConfig(max_extrapolation_s=0.0),
        HistoryConfig(dt_s=0.1, steps=50, max_gap_s=1.5, max_extrapolation_s=2.0),
        HistoryConfig(velocity_tau_s=0.0, acceleration_tau_s=0.0),
    ],
    ids=["one step", "no gap", "no extrapolation", "long", "no smoothing"],
)
def test_every_configuration_is_served(config):
    config = dataclasses.replace(config, acceleration_source="message")
    draw = np.random.default_rng(6)
    history, tracks = TrackHistory(config), {0: [], 1: []}
    for k in range(80):
        stamp_ns = 1_000_000_000 + 100_000_000 * k
        present = np.flatnonzero(draw.random(2) < 0.6)
        position = np.stack([0.5 * k + 10.0 * present, -0.2 * k + 0.0 * present], axis=1)
        velocity = np.tile([5.0, -2.0], (len(present), 1))
        history.update(
            tracked_states(
                stamp_ns,
                "map",
                keys_from_integers(present),
                position,
                velocity=velocity,
                acceleration=np.zeros_like(position),
                yaw=np.full(len(present), 0.25),
            )
        )
        for row, agent in enumerate(present):
            tracks[agent].append((stamp_ns, [*position[row], 5.0, -2.0, 0.0, 0.0, 0.25]))
        check(history.window(), expected_window(tracks, stamp_ns, config))
