# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings through the node's own history: the windows from which scenes are cut.

A window holds nothing later than its stamp, because the history has been shown nothing later when
it is taken. Windows are stored once per instant; which graphs are cut from it is decided later.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history import TrackHistory
from mtpgo_core.schema import HistoryWindow
from mtpgo_core.task import HistoryConfig
from mtpgo_training.recording import Recording

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class TrackedWindow:
    """A window and who its agents are in the recording.

    Attributes:
        window: the window.
        track: [n] index of each agent's track in the recording.
    """

    window: HistoryWindow
    track: IntArray


def cut_windows(
    recording: Recording, history: HistoryConfig, stride_s: float
) -> list[TrackedWindow]:
    """Windows every ``stride_s`` of a recording, each with only its past.

    Args:
        recording: the recording.
        history: how the window is resampled.
        stride_s: time between two windows (s); those nearest to the recording's frames are taken.
    """
    tracks = np.arange(len(recording.track_id), dtype=np.int64)
    return _cut(recording, history, stride_s, tracks)


def cut_restarted_windows(
    recording: Recording,
    history: HistoryConfig,
    stride_s: float,
    within_s: float,
    generator: np.random.Generator,
) -> list[TrackedWindow]:
    """Windows at the same instants, in which every agent was first seen at most ``within_s`` ago.

    Each track is cut into pieces of ``within_s`` with a random phase and each piece gets an
    identity of its own, so that the history forgets at every cut. The short past of an agent is
    thereby exactly what the node would have, estimated derivatives included.
    """
    pieces, owner = _cut_tracks(recording, within_s, generator)
    return _cut(pieces, history, stride_s, owner)


def _cut_tracks(
    recording: Recording, within_s: float, generator: np.random.Generator
) -> tuple[Recording, IntArray]:
    """The recording with each track cut into pieces, and [pieces] the track each belongs to."""
    length = max(1, round(within_s * recording.frame_rate))
    phase = generator.integers(0, length, size=len(recording.track_id))
    number = (recording.frame + phase[recording.track]) // length
    number -= number.min() if len(number) else 0
    code = recording.track * (int(number.max(initial=0)) + 1) + number
    _, first, piece = np.unique(code, return_index=True, return_inverse=True)
    owner = recording.track[first]
    pieces = dataclasses.replace(
        recording,
        track=piece.astype(np.int64),
        track_id=np.arange(len(owner), dtype=np.int64),
        agent_class=recording.agent_class[owner],
        size=recording.size[owner],
        ego_id=None,
    )
    return pieces, owner


def _cut(
    recording: Recording, config: HistoryConfig, stride_s: float, owner: IntArray
) -> list[TrackedWindow]:
    history = TrackHistory(config)
    index = {key.tobytes(): i for i, key in enumerate(recording.key)}
    stride = max(1, round(stride_s * recording.frame_rate))
    windows = []
    first = int(recording.frames[0]) if len(recording) else 0
    for frame, states in zip(recording.frames.tolist(), recording.states(), strict=True):
        history.update(states)
        if (frame - first) % stride:
            continue
        window = history.window(states.stamp_ns)
        if not window.valid[:, -1].any():
            continue
        piece = np.array([index[key.tobytes()] for key in window.key], dtype=np.int64)
        newest = np.full(len(owner), -1)
        np.maximum.at(newest, owner[piece], piece)
        # A piece that has just been cut off would be carried on beside its successor.
        keep = newest[owner[piece]] == piece
        windows.append(TrackedWindow(window.select(keep), owner[piece[keep]]))
    return windows
