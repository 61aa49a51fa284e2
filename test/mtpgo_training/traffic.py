# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small synthetic recordings whose futures can be learned: cars that brake or turn by a rule."""

import numpy as np

from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.scenes.windows import windows_of


def braking_cars(name="01", *, tracks=12, seconds=9.0, rate=10.0, seed=0):
    """Cars on parallel roads, each slowing down by the same law that constant velocity misses."""
    rng = np.random.default_rng(seed)
    frames = np.arange(round(seconds * rate))
    t = frames / rate
    rows = []
    for track in range(tracks):
        speed, phase = rng.uniform(6.0, 14.0), rng.uniform(0.0, 2.0)
        decay = 0.25
        x = speed / decay * (1.0 - np.exp(-decay * (t + phase)))
        v = speed * np.exp(-decay * (t + phase))
        first = int(rng.integers(0, 15)) if track % 3 == 0 else 0
        keep = slice(first, None)
        course = 0.4 * (track % 4)
        along = np.array([np.cos(course), np.sin(course)])
        start = np.array([500.0 + 3.0 * track, -200.0 + 7.0 * track])
        rows.append(
            (
                frames[keep],
                np.full(len(frames), track)[keep],
                (start + x[:, None] * along)[keep],
                (v[:, None] * along)[keep],
                np.full(len(frames), course)[keep],
            )
        )
    return _recording(rows, name, tracks=tracks, rate=rate, seed=seed)


def turning_cars(name="01", *, tracks=14, seconds=30.0, rate=10.0, seed=0):
    """Cars that come along +x one after another and turn left or right by turns, like no other."""
    rng = np.random.default_rng(seed)
    frames = np.arange(round(seconds * rate))
    rows = []
    for track in range(tracks):
        speed, radius = rng.uniform(7.0, 9.0), 14.0
        since = frames / rate - 2.0 * track
        keep = (since >= 0.0) & (since < 14.0)
        gone = speed * since[keep] - 40.0
        angle = np.clip(gone / radius, 0.0, np.pi / 2)
        after = np.maximum(gone - radius * np.pi / 2, 0.0)
        side = 1.0 if track % 2 else -1.0
        x = np.minimum(gone, 0.0) + radius * np.sin(angle)
        y = radius * (1.0 - np.cos(angle)) + after
        course = side * angle
        position = np.stack([300.0 + x, 80.0 + side * y + rng.normal(0.0, 0.2)], axis=1)
        velocity = speed * np.stack([np.cos(course), np.sin(course)], axis=1)
        rows.append((frames[keep], np.full(keep.sum(), track), position, velocity, course))
    return _recording(rows, name, tracks=tracks, rate=rate, seed=seed)


def _recording(rows, name, *, tracks, rate, seed):
    """A recording of cars from rows (frames, track, position, velocity, yaw), one per track."""
    frame, track, position, velocity, yaw = (np.concatenate(c) for c in zip(*rows, strict=True))
    order = np.lexsort((track, frame))
    return Recording(
        name=name,
        layout="ind",
        location="test",
        frame_rate=rate,
        frame=frame[order].astype(np.int64),
        track=track[order].astype(np.int64),
        position=position[order],
        velocity=velocity[order],
        acceleration=np.full((len(frame), 2), np.nan),
        yaw=yaw[order],
        track_id=np.arange(100, 100 + tracks),
        agent_class=np.ones(tracks, dtype=np.uint8),
        size=np.tile([4.5, 1.9], (tracks, 1)),
        sha256=f"{seed:064d}",
    )


def cut_windows(recording, history, stride_s):
    """The windows of a recording that has no cache."""
    return windows_of(recording, SampleTable(take_in(recording, history), history), stride_s)
