# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The history: a stream of messages with any times, identities and numbers."""

from __future__ import annotations

import struct

import numpy as np
from fuzz_target import FuzzTarget

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig

_MESSAGE = struct.Struct("<bB")  # time since the last message (0.1 s), frame and number of objects
_OBJECT = struct.Struct("<B4f")  # identity, position (m), velocity (m/s)
_START_NS = 1_700_000_000_000_000_000


def run(data: bytes) -> None:
    """Read the bytes as messages, and look at the window after each."""
    history = TrackHistory(HistoryConfig(), max_tracks=16)
    at, stamp_ns = 0, _START_NS
    while at + _MESSAGE.size <= len(data):
        step, kind = _MESSAGE.unpack_from(data, at)
        at += _MESSAGE.size
        count = min(kind & 7, (len(data) - at) // _OBJECT.size)
        rows = [_OBJECT.unpack_from(data, at + k * _OBJECT.size) for k in range(count)]
        at += count * _OBJECT.size
        stamp_ns += step * 100_000_000
        values = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 4)
        report = history.update(
            tracked_states(
                stamp_ns,
                "map" if kind < 240 else "odom",
                keys_from_integers([row[0] & 31 for row in rows]),
                values[:, :2],
                velocity=values[:, 2:],
            )
        )
        assert 0 <= report.accepted <= count
        window = history.window()
        assert len(window) <= 16
        assert len(np.unique(window.key, axis=0)) == len(window)
        present = window.valid
        assert np.isfinite(window.position[present]).all(), "a sample that is not finite"
        assert not np.isinf(window.velocity).any(), "an infinite velocity"
        assert np.isnan(window.position[~present]).all(), "an absent sample that is a number"


def seeds() -> list[bytes]:
    """Return three agents at constant velocity, and one that jumps."""
    steady = b"".join(
        _MESSAGE.pack(1, 3) + b"".join(_OBJECT.pack(i, 9.0 * i, k, 0.0, 10.0) for i in range(3))
        for k in range(12)
    )
    jumping = b"".join(
        _MESSAGE.pack(2, 1) + _OBJECT.pack(1, 500.0 * (k % 3), 0.0, 1.0, 0.0) for k in range(6)
    )
    return [b"", steady, jumping]


def targets() -> list[FuzzTarget]:
    """Return the target of this file."""
    return [FuzzTarget("history", run, seeds)]
