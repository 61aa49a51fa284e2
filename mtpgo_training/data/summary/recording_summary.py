# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of one recording: duration, road users, speeds, manoeuvres, defects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mtpgo_core.schema import MOVING_MPS, AgentClass, Float64Array
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.manoeuvres import MANOEUVRES, label, members
from mtpgo_training.data.recording import Int64Array, Recording
from mtpgo_training.data.summary.recording_defects import BRIDGED_S, DefectList, find_defects
from mtpgo_training.data.summary.track_steps import TrackSteps, lengths

HORIZON_S, STEP_S = 5.0, 0.2
"""Time over which a manoeuvre is looked for, and its steps (s): those of the default task."""

EVERY_S = 1.0
"""Time between two instants at which manoeuvres are counted (s); chosen."""

MOST_INSTANTS = 50_000
"""Road users and instants of a recording whose manoeuvre is counted, evenly spread; chosen,
bounds the time: they take a second."""

_AT_ONCE = 4096
"""Manoeuvres found together; chosen, bounds the memory."""

BINS = 120
"""Parts of a recording over which its road users are counted; chosen for a line in a picture."""

QUANTILES = (0.05, 0.5, 0.95)

SPEEDS_KEPT = 200
"""Speeds of each class that are kept of a recording, at equal shares of its rows; chosen: with
them quantiles over many recordings are exact to 0.5 % of the rows."""


@dataclass(frozen=True)
class RecordingSummary:
    """What is in a recording.

    Attributes:
        name, layout, location: of the recording.
        duration_s: from the first to the last frame (s).
        frame_rate: frames per second (Hz).
        rows: rows.
        tracks: road users.
        classes: road users by class.
        agents_mean, agents_most: road users at a time, those between two rows of theirs included
            if the history bridges the time between them.
        agents_over_time: [bins, 2] time since the first frame (s), and mean number of road users
            per frame that has any.
        speed: by class and for ``all``: ``rows``, ``moving`` (share above 0.5 m/s), and of the
            moving rows the quantiles ``q05``, ``q50``, ``q95`` and ``max`` (m/s).
        moving_mps: by class and for ``all``, up to ``SPEEDS_KEPT`` speeds of the moving rows at
            equal shares of them, ascending (m/s); from them follow quantiles over recordings.
        known: share of rows (tracks for ``class`` and ``size``) in which a value is known.
        manoeuvres: share of each among the road users observed over the whole horizon.
        manoeuvre_count: number of those road users and instants.
        lanes: number of lane markings.
        extent_m: size of the observed area along x and y (m).
        defects: what may be wrong.
    """

    name: str
    layout: str
    location: str
    duration_s: float
    frame_rate: float
    rows: int
    tracks: int
    classes: Mapping[str, int]
    agents_mean: float
    agents_most: int
    agents_over_time: Float64Array
    speed: Mapping[str, Mapping[str, float]]
    moving_mps: Mapping[str, Float64Array]
    known: Mapping[str, float]
    manoeuvres: Mapping[str, float]
    manoeuvre_count: int
    lanes: int
    extent_m: tuple[float, float]
    defects: tuple[DefectList, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON can write it."""
        others = ("agents_over_time", "moving_mps", "defects")
        plain = {k: v for k, v in vars(self).items() if k not in others}
        return {
            **plain,
            "extent_m": list(self.extent_m),
            "agents_over_time": np.round(self.agents_over_time, 3).tolist(),
            "defects": {
                item.kind: {
                    "count": item.count,
                    "places": [{"place": d.place, "text": d.text} for d in item.first],
                }
                for item in self.defects
            },
        }


def summarise(recording: Recording) -> RecordingSummary:
    """Return what is in a recording.

    Args:
        recording: the recording, with at least one row.
    """
    frames = recording.frames
    count = _present(recording)
    names = np.array([member.name.lower() for member in AgentClass])
    numbers = np.bincount(recording.agent_class, minlength=len(names))
    shares, manoeuvre_count = _manoeuvres(recording)
    speeds, moving_mps = _speeds(recording, names)
    extent = np.ptp(recording.position, axis=0)
    return RecordingSummary(
        name=recording.name,
        layout=recording.layout,
        location=recording.location,
        duration_s=recording.duration_s,
        frame_rate=recording.frame_rate,
        rows=len(recording),
        tracks=len(recording.track_id),
        classes={str(names[i]): int(numbers[i]) for i in np.flatnonzero(numbers)},
        agents_mean=float(count.mean()),
        agents_most=int(count.max()),
        agents_over_time=_over_time((frames - frames[0]) / recording.frame_rate, count),
        speed=speeds,
        moving_mps=moving_mps,
        known=_known(recording),
        manoeuvres=shares,
        manoeuvre_count=manoeuvre_count,
        lanes=len(recording.lanes),
        extent_m=(float(extent[0]), float(extent[1])),
        defects=tuple(find_defects(recording)),
    )


def _present(recording: Recording) -> Int64Array:
    """Return [frames] the number of road users there.

    Where sensors take turns, each frame has the rows of few of the road users that are there.
    """
    steps = TrackSteps.of(recording)
    away = steps.dt_s > BRIDGED_S
    starts, ends = np.ones((2, len(recording)), dtype=np.bool_)
    starts[steps.after[~away]] = False
    ends[steps.before[~away]] = False
    begun = np.searchsorted(recording.frame[starts], recording.frames, side="right")
    gone = np.searchsorted(recording.frame[ends], recording.frames, side="left")
    return np.asarray(begun - gone, dtype=np.int64)


def _over_time(time_s: Float64Array, count: np.ndarray) -> Float64Array:
    """Return [bins, 2] times (s) and mean numbers of road users."""
    bins = min(BINS, len(time_s))
    width = max(float(time_s[-1]), 1e-9) / bins
    which = np.minimum((time_s / width).astype(np.int64), bins - 1)
    total = np.bincount(which, weights=count, minlength=bins)
    frames = np.bincount(which, minlength=bins)
    return np.stack([(np.arange(bins) + 0.5) * width, total / np.maximum(frames, 1)], axis=1)


def _known(recording: Recording) -> dict[str, float]:
    def share(values: np.ndarray) -> float:
        known = np.isfinite(values)
        return float((known.all(axis=1) if known.ndim > 1 else known).mean())

    return {
        "velocity": share(recording.velocity),
        "acceleration": share(recording.acceleration),
        "yaw": share(recording.yaw),
        "size": share(recording.size),
        "class": float((recording.agent_class != AgentClass.UNKNOWN).mean()),
    }


def _speeds(
    recording: Recording, names: np.ndarray
) -> tuple[dict[str, dict[str, float]], dict[str, Float64Array]]:
    """Return the speeds by class, the recorded ones, else those of the movement: both fields."""
    speed = lengths(recording.velocity)
    steps = TrackSteps.of(recording)
    moved = np.full(len(recording), np.nan)
    moved[steps.after] = steps.speed_mps
    speed = np.where(np.isfinite(speed), speed, moved)
    kind = recording.agent_class[recording.track]
    groups = {str(names[i]): kind == i for i in np.unique(kind)}
    out: dict[str, dict[str, float]] = {}
    kept: dict[str, Float64Array] = {}
    for name, rows in {"all": np.ones(len(kind), dtype=np.bool_), **groups}.items():
        values = speed[rows & np.isfinite(speed)]
        moving = values[values > MOVING_MPS]
        entry = {
            "rows": float(len(values)),
            "moving": float(len(moving) / len(values)) if len(values) else 0.0,
        }
        if len(moving):
            for q, value in zip(QUANTILES, np.quantile(moving, QUANTILES), strict=True):
                entry[f"q{round(100 * q):02d}"] = float(value)
            entry["max"] = float(moving.max())
        out[name] = entry
        count = min(len(moving), SPEEDS_KEPT)
        levels = (np.arange(count) + 0.5) / max(1, count)
        kept[name] = np.quantile(moving, levels) if count else moving
    return out, kept


def _manoeuvres(recording: Recording) -> tuple[dict[str, float], int]:
    """Return the share of each manoeuvre, and the number of road users and instants counted."""
    second = np.floor((recording.frame - recording.frame[0]) / recording.frame_rate / EVERY_S)
    # The first row of each road user in each second.
    _, rows = np.unique(np.stack([recording.track, second]), axis=1, return_index=True)
    # A road user that is not there for the horizon has no manoeuvre: most of the work is saved.
    last = np.zeros(len(recording.track_id), dtype=np.int64)
    np.maximum.at(last, recording.track, recording.frame)
    enough = HORIZON_S * recording.frame_rate - 1e-6
    rows = rows[last[recording.track[rows]] - recording.frame[rows] >= enough]
    rows = np.sort(rows)[:: max(1, -(-len(rows) // MOST_INSTANTS))]
    future = FutureTable(recording)
    horizon = round(HORIZON_S / STEP_S)
    dt_ns = round(STEP_S * 1e9)
    counts, whole = np.zeros(len(MANOEUVRES), dtype=np.int64), 0
    stamps = recording.start_time_ns + np.round(
        recording.frame[rows] * (1e9 / recording.frame_rate)
    ).astype(np.int64)
    for begin in range(0, len(rows), _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        track = recording.track[rows[some]]
        path = future.at(track, stamps[some] - dt_ns, horizon + 1, STEP_S)
        labels = label(
            path.position, path.known, STEP_S, recording.agent_class[track], recording.lanes
        )
        whole += int(path.known.all(axis=1).sum())
        counts += [int(members(labels, name).sum()) for name in MANOEUVRES]
    return {
        name: float(n / whole) if whole else 0.0
        for name, n in zip(MANOEUVRES, counts.tolist(), strict=True)
    }, whole
