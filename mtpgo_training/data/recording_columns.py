# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as plain columns and back, for the cache."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from mtpgo_training.data.recording import Columns, Recording

_ARRAYS = (
    "frame",
    "track",
    "position",
    "velocity",
    "acceleration",
    "yaw",
    "track_id",
    "agent_class",
    "size",
)
_FACTS = (
    "name",
    "layout",
    "location",
    "frame_rate",
    "ego_id",
    "sha256",
    "start_time_ns",
    "counts",
)


def pack(recordings: Iterable[Recording]) -> Columns:
    """Return recordings as columns; each column's name begins with the recording's number."""
    columns: Columns = {}
    facts = []
    for number, recording in enumerate(recordings):
        facts.append({name: getattr(recording, name) for name in _FACTS})
        for name in _ARRAYS:
            columns[f"{number}-{name}"] = getattr(recording, name)
        columns[f"{number}-lanes"] = np.concatenate([np.zeros((0, 2)), *recording.lanes])
        lengths = np.array([len(line) for line in recording.lanes], dtype=np.int64)
        columns[f"{number}-lane_lengths"] = lengths
        if recording.track_key is not None:
            columns[f"{number}-track_key"] = recording.track_key
    text = json.dumps(facts).encode()
    return {"facts": np.frombuffer(text, dtype=np.uint8), **columns}


def unpack(columns: Columns) -> list[Recording]:
    """Return the recordings that :func:`pack` made columns of."""
    recordings = []
    for number, facts in enumerate(json.loads(columns["facts"].tobytes())):
        ends = np.cumsum(columns[f"{number}-lane_lengths"])
        lanes = np.split(columns[f"{number}-lanes"], ends)[:-1]
        arrays: dict[str, Any] = {name: columns[f"{number}-{name}"] for name in _ARRAYS}
        recordings.append(
            Recording(
                **facts,
                **arrays,
                lanes=tuple(lanes),
                track_key=columns.get(f"{number}-track_key"),
            )
        )
    return recordings
