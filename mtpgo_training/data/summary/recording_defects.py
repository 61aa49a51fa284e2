# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Defects of recordings by kind, with the places where they are.

A defect is what makes a training or an evaluation on the recording wrong, or what a user most
likely did not know: none of them stops a training.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import wrap
from mtpgo_core.history.resampling import TOLERANCE_NS
from mtpgo_core.schema import LARGEST_SIZE_M, AgentClass, BoolArray, Float64Array
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.checks.unit_clues import impossible_velocities, unit_clue
from mtpgo_training.data.readers.tables.frame_grid import FREE_RATE
from mtpgo_training.data.recording import Int64Array, Recording
from mtpgo_training.data.summary.track_steps import TrackSteps, lengths

MOST_PLACES = 100
"""Places kept of each kind and recording; chosen."""

JUMP_M, JUMP_MPSS = 2.0, 20.0
"""A position farther than this from where the last step led (m), besides what this acceleration
does in the time (m/s^2), is a jump; chosen above tracking noise and twice what tyres hold."""

BRIDGED_S = HistoryConfig().max_gap_s + TOLERANCE_NS * 1e-9
"""Longest time between two rows of a road user that the history bridges (s)."""

CONTINUED_S = 1.0
"""After a longer step (s) nothing is said of where the road user should be; chosen."""

MOVING_MPS = 2.0
"""Only faster road users have a direction to be compared with (m/s); chosen above noise."""

WRONG_MPS, WRONG_SHARE = 2.0, 0.3
"""A recorded velocity that differs from the movement by more than this (m/s) and this share of
the speed is wrong; chosen: a wrong axis or unit differs by far more, a filter's delay by less."""

WRONG_RAD = np.radians(60.0)
"""A heading that differs from the movement by more than this (rad) is wrong; chosen above the
side slip of any road user that drives forward."""

SHORTEST_M, WIDEST_M = 0.5, 4.0
"""No vehicle is shorter or wider (m); chosen: below a bicycle, above abnormal loads on most roads.
Another unit, or length and width in each other's place, is beyond."""

SHORT_S = 1.0
"""A track observed for less than this has no future to be predicted (s); chosen."""

EMPTY_S = 1.0
"""Time without any road user from which on it is reported (s); chosen."""

KINDS = {
    "unreadable": "files that cannot be read",
    "copy": "recordings with the content of another, which a training leaves out",
    "unit": "recordings whose times or positions seem to be in another unit",
    "gap": "road users not observed for longer than the history bridges",
    "jump": "positions far from where the movement led",
    "too fast": "moves that the history rejects as faster than any road user",
    "rejected velocity": "rows that the history leaves out, for their recorded velocity is that of"
    " no road user",
    "velocity": "road users whose recorded velocity does not fit their movement",
    "heading": "road users whose heading does not fit their movement",
    "repeated position": "positions repeated exactly while the recorded velocity goes on",
    "short track": f"road users observed for less than {SHORT_S:g} s",
    "empty time": f"times without any road user, longer than {EMPTY_S:g} s",
    "no rate": "recordings without a steady frame rate",
    "no class": "road users without a class",
    "no size": "vehicles without a size",
    "size": "vehicles that are wider than long, or of a size that none has",
}
"""Kinds of defects and what they are."""


@dataclass(frozen=True)
class Defect:
    """One defect.

    Attributes:
        kind: a name in ``KINDS``.
        place: where it is, in words.
        text: how large it is, in words.
    """

    kind: str
    place: str
    text: str = ""

    def __str__(self) -> str:
        return f"{self.place}: {self.text}" if self.text else self.place


@dataclass(frozen=True)
class DefectList:
    """The defects of one kind.

    Attributes:
        kind: a name in ``KINDS``.
        count: how many there are.
        first: the first of them, up to ``MOST_PLACES``.
    """

    kind: str
    count: int
    first: tuple[Defect, ...]


def find_defects(recording: Recording) -> list[DefectList]:
    """Return the defects of a recording, the kinds in the order of ``KINDS``, without empty ones.

    Args:
        recording: the recording.
    """
    if not len(recording):
        return []
    found = _Finder(recording)
    by_kind = {item.kind: item for item in found.all() if item.count}
    return [by_kind[kind] for kind in KINDS if kind in by_kind]


class _Finder:
    """Looks for each kind of defect in one recording."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.steps = TrackSteps.of(recording)
        self.history = HistoryConfig()
        self.tracks = len(recording.track_id)

    def all(self) -> Iterator[DefectList]:
        """Yield the defects of every kind."""
        steps, history = self.steps, self.history
        clue = unit_clue(self.recording)
        first = (Defect("unit", f"recording {self.recording.name}", clue),) if clue else ()
        yield DefectList("unit", len(first), first)
        yield self._steps(
            "gap",
            steps.dt_s > BRIDGED_S,
            lambda i: f"not observed for {steps.dt_s[i]:.2f} s",
        )
        fast = steps.speed_mps > history.max_speed_mps
        yield self._steps("too fast", fast, lambda i: f"{steps.speed_mps[i]:.0f} m/s")
        said_mps = lengths(self.recording.velocity)
        yield self._rows(
            "rejected velocity",
            impossible_velocities(self.recording),
            lambda row: f"{said_mps[row]:.0f} m/s",
        )
        off = self._off_course()
        yield self._steps("jump", (off > 0) & ~fast, lambda i: f"{off[i]:.1f} m off its course")
        yield self._frozen()
        yield self._velocity()
        yield self._heading()
        observed_s = self._observed_s()
        yield self._tracks("short track", observed_s < SHORT_S, lambda t: f"{observed_s[t]:.2f} s")
        yield self._tracks("no class", self.recording.agent_class == AgentClass.UNKNOWN)
        vehicle = ~np.isin(
            self.recording.agent_class,
            (AgentClass.PEDESTRIAN, AgentClass.BICYCLE, AgentClass.ANIMAL, AgentClass.UNKNOWN),
        )
        length, width = self.recording.size.T
        yield self._tracks("no size", vehicle & ~np.isfinite(length + width))
        odd = (length < np.maximum(width, SHORTEST_M)) | (width > WIDEST_M)  # false for NaN
        odd |= length > LARGEST_SIZE_M
        yield self._tracks(
            "size", vehicle & odd, lambda t: f"{length[t]:.3g} m long, {width[t]:.3g} m wide"
        )
        yield self._empty_times()
        step_s = float(np.median(steps.dt_s)) if len(steps.dt_s) else 0.0
        if self.recording.frame_rate == FREE_RATE and step_s > 2.0 / FREE_RATE:
            typical = f"a row every {step_s:.3f} s, but not evenly"
            place = f"recording {self.recording.name}"
            yield DefectList("no rate", 1, (Defect("no rate", place, typical),))

    def _steps(self, kind: str, bad: BoolArray, text: Callable[[int], str]) -> DefectList:
        """Return the defects of some steps, by time."""
        which = np.flatnonzero(bad)
        which = which[np.argsort(self.recording.frame[self.steps.before[which]], kind="stable")]
        first = tuple(
            Defect(kind, self._place(int(self.steps.before[i])), text(int(i)))
            for i in which[:MOST_PLACES].tolist()
        )
        return DefectList(kind, len(which), first)

    def _rows(self, kind: str, bad: BoolArray, text: Callable[[int], str]) -> DefectList:
        """Return the defects of some rows; these are in the order of time."""
        which = np.flatnonzero(bad)
        first = tuple(
            Defect(kind, self._place(row), text(row)) for row in which[:MOST_PLACES].tolist()
        )
        return DefectList(kind, len(which), first)

    def _tracks(
        self, kind: str, bad: BoolArray, text: Callable[[int], str] = lambda track: ""
    ) -> DefectList:
        which = np.flatnonzero(bad)
        name = self.recording.name
        first = tuple(
            Defect(kind, f"recording {name}, track {self.recording.track_id[t]}", text(int(t)))
            for t in which[:MOST_PLACES].tolist()
        )
        return DefectList(kind, len(which), first)

    def _place(self, row: int) -> str:
        recording = self.recording
        since_s = (recording.frame[row] - recording.frame[0]) / recording.frame_rate
        track = recording.track_id[recording.track[row]]
        return (
            f"recording {recording.name}, track {track}, {since_s:.2f} s "
            f"(frame {recording.frame[row]})"
        )

    def _observed_s(self) -> Float64Array:
        """Return [tracks] time from the first to the last row (s)."""
        frame, track = self.recording.frame, self.recording.track
        first = np.full(self.tracks, np.iinfo(np.int64).max)
        last = np.full(self.tracks, np.iinfo(np.int64).min)
        np.minimum.at(first, track, frame)
        np.maximum.at(last, track, frame)
        return np.asarray((last - first) / self.recording.frame_rate)

    def _off_course(self) -> Float64Array:
        """Return [steps] the distance from where the step before led (m), else 0."""
        steps = self.steps
        off = np.zeros(len(steps.dt_s))
        if len(off) < 2:
            return off
        follows = (steps.before[1:] == steps.after[:-1]) & (steps.track[1:] == steps.track[:-1])
        follows &= (steps.dt_s[1:] <= CONTINUED_S) & (steps.dt_s[:-1] <= CONTINUED_S)
        led = steps.move[:-1] * (steps.dt_s[1:] / steps.dt_s[:-1])[:, None]
        distance = lengths(steps.move[1:] - led)
        between_s = (steps.dt_s[1:] + steps.dt_s[:-1]) / 2
        allowed = JUMP_M + JUMP_MPSS * steps.dt_s[1:] * between_s
        off[1:] = np.where(follows & (distance > allowed), distance, 0.0)
        # The way back after a jump is no second one.
        for i in (np.flatnonzero((off[1:] > 0) & (off[:-1] > 0)) + 1).tolist():
            if off[i - 1] > 0:
                off[i] = 0.0
        return off

    def _frozen(self) -> DefectList:
        steps = self.steps
        speed = lengths(steps.velocity)
        bad = (steps.distance_m == 0.0) & (speed > MOVING_MPS)
        return self._steps(
            "repeated position", bad, lambda i: f"the velocity says {speed[i]:.1f} m/s"
        )

    def _velocity(self) -> DefectList:
        """Road users whose velocity is wrong in most of the steps in which it can be compared."""
        steps = self.steps
        moved = steps.move / steps.dt_s[:, None]
        wrong = lengths(moved - steps.velocity)
        speed = lengths(moved)
        usable = np.isfinite(wrong) & (steps.dt_s <= CONTINUED_S)
        usable &= (speed > MOVING_MPS) | (lengths(steps.velocity) > MOVING_MPS)
        bad = usable & (wrong > np.maximum(WRONG_MPS, WRONG_SHARE * speed))
        share = self._share(bad, usable)
        return self._tracks(
            "velocity", share > 0.5, lambda t: f"in {100 * share[t]:.0f} % of its steps"
        )

    def _heading(self) -> DefectList:
        steps = self.steps
        yaw = self.recording.yaw[steps.before]
        speed = steps.speed_mps
        usable = np.isfinite(yaw) & (speed > MOVING_MPS) & (steps.dt_s <= CONTINUED_S)
        course = np.arctan2(steps.move[:, 1], steps.move[:, 0])
        apart = np.abs(wrap(yaw - course))
        share = self._share(usable & (apart > WRONG_RAD), usable)
        return self._tracks(
            "heading", share > 0.5, lambda t: f"in {100 * share[t]:.0f} % of its steps"
        )

    def _share(self, bad: BoolArray, usable: BoolArray) -> Float64Array:
        """Return [tracks] the share of bad steps among those that can be compared."""
        all_of = np.bincount(self.steps.track[usable], minlength=self.tracks)
        bad_of = np.bincount(self.steps.track[bad], minlength=self.tracks)
        return np.asarray(bad_of / np.maximum(all_of, 1))

    def _empty_times(self) -> DefectList:
        frames: Int64Array = self.recording.frames
        empty_s = np.diff(frames) / self.recording.frame_rate
        which = np.flatnonzero(empty_s > EMPTY_S)
        first = tuple(
            Defect(
                "empty time",
                f"recording {self.recording.name}, "
                f"{(frames[i] - frames[0]) / self.recording.frame_rate:.2f} s (frame {frames[i]})",
                f"no road user for {empty_s[i]:.2f} s",
            )
            for i in which[:MOST_PLACES].tolist()
        )
        return DefectList("empty time", len(which), first)
