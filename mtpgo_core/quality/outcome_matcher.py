# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compares published predictions with the observations that follow them."""

from __future__ import annotations

import dataclasses
from collections import Counter, deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.resampling import TOLERANCE_NS
from mtpgo_core.history.stream_guard import UpdateReport
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import heaviest_modes, select
from mtpgo_core.quality.outcomes import UNKNOWN, Outcomes
from mtpgo_core.quality.prediction_memory import KeptPrediction, MemoryLimits, PredictionMemory
from mtpgo_core.schema import (
    BoolArray,
    Float64Array,
    HistoryWindow,
    IndexArray,
    KeyArray,
    Prediction,
)
from mtpgo_core.task.calibration import calibration_groups
from mtpgo_core.task.task_description import HistoryConfig

_WAITING = 8
"""Most predictions that wait for the next observation; chosen: more come only when the input
stops, and the last one is as good as the others then."""


_LIMITS = MemoryLimits()
_NEVER_NS = np.iinfo(np.int64).max


class OutcomeMatcher:
    """Keeps predictions until their horizon has passed, and gives each step its truth.

    The truth is the history's: a position of the same track, observed at that time or
    interpolated within ``max_gap_s``. Where the history ends a track (an impossible move, a jump
    of the clock, another frame), predictions of it get no truth from then on.

    Args:
        config: of the history.
        limits: bounds of the memory.

    Attributes:
        memory: the predictions.
        unknown: number of steps without a truth by cause, see
            :data:`~mtpgo_core.quality.outcomes.UNKNOWN`.
    """

    def __init__(self, config: HistoryConfig, limits: MemoryLimits = _LIMITS) -> None:
        self._max_gap_ns = config.max_gap_ns
        self._limits = limits
        self.memory = PredictionMemory(limits, config.max_gap_s)
        self.unknown = Counter(dict.fromkeys(UNKNOWN, 0))
        self._waiting: deque[tuple[KeyArray, KeptPrediction]] = deque(maxlen=_WAITING)
        self._restarted: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._awaited: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._expires_ns = _NEVER_NS

    def add(
        self, prediction: Prediction, window: HistoryWindow, max_modes: int | None = None
    ) -> None:
        """Keep a published prediction; any thread.

        Args:
            prediction: as published.
            window: that it was made of; constant velocity starts there.
            max_modes: most modes that are published; None for all.
        """
        present = find_sort_keys(sort_keys(window.key), sort_keys(prediction.key))
        row = np.flatnonzero(present >= 0)
        if len(row) < len(prediction):
            prediction = select(prediction, row)
        weight, modes = heaviest_modes(
            prediction, min(self._limits.modes, max_modes or self._limits.modes)
        )
        window = window.select(present[row])
        steps = len(prediction.time_s)
        start_s = (window.stamp_ns - prediction.stamp_ns) * 1e-9
        dt_s = float(prediction.time_s[0]) - start_s if steps else 0.0
        cv = predict_constant_velocity(window, horizon_steps=steps, dt_s=dt_s)
        new = KeptPrediction(
            stamp_ns=prediction.stamp_ns,
            time_s=prediction.time_s,
            row=row,
            number=np.full(len(prediction), -1),
            group=calibration_groups(window.agent_class, window.velocity[:, -1]),
            source=prediction.source,
            weight=weight,
            mean=prediction.mean[:, :modes, :, :2],
            covariance=prediction.covariance[:, :modes],
            sigma_factor_50=prediction.sigma_factor_50,
            cv_mean=cv.mean[:, 0, :, :2],
            cv_covariance=cv.covariance[:, 0],
        )
        self._waiting.append((prediction.key, new))

    def clear(self, cause: str) -> None:
        """Forget all predictions, because of a cause of ``UNKNOWN``."""
        self._waiting.clear()
        self.unknown[cause] += self.memory.open_steps
        self.memory.clear()

    def update(self, history: TrackHistory, report: UpdateReport) -> Outcomes:
        """Return the outcomes that the last observation of the history reveals.

        Args:
            history: after the observation.
            report: on it.
        """
        before = self.unknown.copy()
        if report.clock_reset or (report.frame_changed and not report.wrong_frame):
            self.clear("clock_reset" if report.clock_reset else "frame_changed")
        if len(history.restarted):
            open_numbers = np.union1d(self._restarted, history.restarted)
            self._restarted = np.intersect1d(open_numbers, self.memory.number)
        now_ns = history.newest_stamp_ns or 0
        self._take_waiting(history, now_ns)
        parts = self._resolve_all(history, now_ns) if self._any_ready(history, now_ns) else []
        return _outcomes(self.memory, now_ns, parts, self.unknown - before)

    def _any_ready(self, history: TrackHistory, now_ns: int) -> bool:
        """Return whether any step may be resolved now.

        Some are due but wait for an observation of their track that may still come.
        """
        due = self.memory.next_ns <= now_ns + TOLERANCE_NS or now_ns > self._expires_ns
        return due or bool(len(self._awaited) and np.isin(self._awaited, history.observed).any())

    def _resolve_all(self, history: TrackHistory, now_ns: int) -> list[_Resolved]:
        """Resolve all steps whose truth is known or will never be."""
        memory, parts = self.memory, list[_Resolved]()
        awaited, expires_ns = [], _NEVER_NS
        cycle, agent, target_ns = memory.due(now_ns)
        while len(cycle):
            truth, ready = self._truth(history, now_ns, memory.number[cycle, agent], target_ns)
            awaited.append(memory.number[cycle[~ready], agent[~ready]])
            expires_ns = min(expires_ns, int(target_ns[~ready].min(initial=_NEVER_NS)))
            cycle, agent, truth = cycle[ready], agent[ready], truth[ready]
            step = memory.step[cycle, agent]
            error = memory.resolve(cycle, agent, truth)
            parts.append(_Resolved(cycle, agent, step, truth, error))
            cycle, agent, target_ns = memory.due(now_ns, (cycle, agent))
        memory.find_next(now_ns)
        self._awaited = np.unique(np.concatenate([_NO_ROWS, *awaited]))
        self._expires_ns = min(expires_ns, _NEVER_NS - self._max_gap_ns - TOLERANCE_NS)
        self._expires_ns += self._max_gap_ns + TOLERANCE_NS
        return parts

    def _take_waiting(self, history: TrackHistory, now_ns: int) -> None:
        """Move the predictions that were published since the last observation to the memory."""
        while self._waiting:
            key, new = self._waiting.popleft()
            if new.stamp_ns > now_ns:
                # Made before the clock was set back: the memory would leave out all others as too
                # soon after it, until the clock reaches its time again.
                self.unknown["no_track"] += len(key) * len(new.time_s)
                continue
            number = history.track_numbers(key, new.stamp_ns)
            kept = self.memory.add(dataclasses.replace(new, number=number))
            self.unknown["no_track"] += int(kept) * int((number < 0).sum()) * len(new.time_s)

    def _truth(
        self,
        history: TrackHistory,
        now_ns: int,
        number: NDArray[np.int64],
        target_ns: NDArray[np.int64],
    ) -> tuple[Float64Array, BoolArray]:
        """Return the truth of steps that are due, and whether it is final.

        Args:
            history: after the newest observation.
            now_ns: time of that (ns).
            number: [m] tracks.
            target_ns: [m] times (ns).

        Returns:
            [m, 2] positions (m), NaN where there is none, and [m] where no later observation can
            change that; those that are final and have none are counted.
        """
        times_ns, time = np.unique(target_ns, return_inverse=True)
        seen = history.observed_positions(times_ns)
        truth = np.full((len(number), 2), np.nan)
        alive = np.isin(number, seen.number)
        known, ready = np.zeros_like(alive), ~alive
        if alive.any():
            row = np.searchsorted(seen.number, number[alive])
            last_ns, target = seen.last_ns[row], target_ns[alive]
            known[alive] = seen.known[row, time[alive]]
            truth[alive] = seen.position[row, time[alive]]
            truth[~known] = np.nan
            # After a gap that is too long, no later observation tells where a track was in it.
            lost = now_ns > np.maximum(last_ns + self._max_gap_ns, target) + TOLERANCE_NS
            ready[alive] = lost | (last_ns >= target - TOLERANCE_NS)
        restarted = np.isin(number, self._restarted)
        causes = {"gap": alive & ~known, "restarted": restarted, "left": ~alive & ~restarted}
        for cause, rows in causes.items():
            self.unknown[cause] += int((rows & ready).sum())
        return truth, ready


class _Resolved(NamedTuple):
    """Steps that were resolved together: [m] rows, truths [m, 2] and mean errors [m, 2] (m)."""

    cycle: IndexArray
    agent: IndexArray
    step: IndexArray
    truth: Float64Array
    error: Float64Array


_NO_ROWS, _NO_VALUES = np.empty(0, dtype=np.intp), np.empty((0, 2))
_NOTHING = _Resolved(_NO_ROWS, _NO_ROWS, _NO_ROWS, _NO_VALUES, _NO_VALUES)


def _outcomes(
    memory: PredictionMemory, now_ns: int, parts: list[_Resolved], unknown: Counter[str]
) -> Outcomes:
    """Return the outcomes of all parts, in the order of time."""
    if len(parts) == 1:
        c, a, step, truth, error = parts[0]
    else:
        c, a, step, truth, error = (
            map(np.concatenate, zip(_NOTHING, *parts, strict=True)) if parts else _NOTHING
        )
    return Outcomes(
        now_ns=now_ns,
        track=memory.number[c, a],
        stamp_ns=memory.stamp_ns[c],
        step=step,
        time_s=memory.time_s[c, step],
        group=memory.group[c, a],
        source=memory.source[c, a],
        truth=truth,
        ade=error[:, 0],
        cv_ade=error[:, 1],
        unknown=dict(unknown),
        _memory=memory,
        _cycle=c,
        _agent=a,
    )
