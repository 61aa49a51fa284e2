# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings with gaps, jumps, jitter and unknown values, and their windows in the node."""

import dataclasses

import numpy as np
from traffic import braking_cars

from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.windows import frames_every

FIELDS = ("key", "agent_class", "z", "size", "position", "velocity", "acceleration", "yaw")


def odd_recording(seed=0, rate=25.0):
    """Everything that the history has a rule for: gaps, jumps, unknown values, reused numbers."""
    rng = np.random.default_rng(seed)
    plain = braking_cars(tracks=14, seconds=12.0, rate=rate, seed=seed)
    rows = len(plain)
    keep = rng.random(rows) > 0.03  # single rows are missing
    for track in range(0, 14, 3):  # gaps that are bridged, masked, and forgotten
        start, length = rng.uniform(1.0, 5.0), rng.choice([0.3, 0.8, 2.0, 4.5])
        time = plain.frame / rate
        keep &= ~((plain.track == track) & (time > start) & (time < start + length))
    position, velocity = plain.position.copy(), plain.velocity.copy()
    position[(plain.track == 1) & (plain.frame > 120)] += 80.0  # a number used again elsewhere
    position[rng.random(rows) < 0.01] = np.nan
    position[rng.random(rows) < 0.003] = np.inf
    velocity[rng.random(rows) < 0.2] = np.nan
    velocity[plain.track == 4] = np.nan
    velocity[rng.random(rows) < 0.005] = 300.0
    yaw = plain.yaw.copy()
    yaw[rng.random(rows) < 0.3] = np.nan
    yaw[plain.track == 5] = np.nan
    odd = dataclasses.replace(
        plain,
        position=position,
        velocity=velocity,
        acceleration=rng.normal(0.0, 1.0, (rows, 2)),
        yaw=yaw,
        track_id=np.roll(plain.track_id, 5),  # the keys are not in the order of the tracks
        agent_class=rng.integers(0, 5, 14).astype(np.uint8),
    )
    return odd.select_rows(keep)


def jittered_recording(seed=0):
    """25 Hz with a jitter of 0.04 s on a grid of 1 ms; some messages are closer than 5 ms."""
    rng = np.random.default_rng(seed)
    plain = braking_cars(tracks=8, seconds=10.0, rate=25.0, seed=seed)
    stamps = np.unique(plain.frame)
    moved = np.sort(stamps * 40 + rng.integers(-20, 21, len(stamps)))
    moved += np.arange(len(moved))  # no two at the same time
    return dataclasses.replace(
        plain, frame_rate=1000.0, frame=moved[np.searchsorted(stamps, plain.frame)]
    )


def replayed(recording, history, stride_s):
    """Windows of the node's own history every ``stride_s``."""
    frames = frames_every(recording, stride_s).tolist()
    return list(replay(recording, history, [recording.stamp_ns(frame) for frame in frames]))


def assert_same_window(a, b):
    assert a.stamp_ns == b.stamp_ns
    assert a.frame_id == b.frame_id
    np.testing.assert_array_equal(a.valid, b.valid)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_array_equal(a.covariance, b.covariance)
