# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From an observation to the work that it starts, with every odd one counted. No ROS in here.

Everything here runs on the subscription's thread; what it hands on is not changed any more, so
the worker needs no lock.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mtpgo_core.history.track_history import TrackHistory, UpdateReport
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_core.schema import HistoryWindow, Prediction, TrackedStates
from mtpgo_ros.diagnostics.counters import Statistics
from mtpgo_ros.node.rate_limiter import Schedule
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_PATIENCE = 3
"""Observations from the future in a row after which the stream's clock is taken as it is."""

LONGEST_DELAY_S = 0.5
"""Delays beyond this are not compensated: the history is not extrapolated farther (s)."""

_COUNTED = tuple(
    field.name
    for field in dataclasses.fields(UpdateReport)
    if field.name not in ("accepted", "new_tracks", "forgotten")
)


@dataclass(frozen=True)
class Work:
    """What a prediction is made from.

    Attributes:
        window: the history up to the horizon's start.
        stamp_ns: time of the observation (ns); the window's is later under delay compensation.
    """

    window: HistoryWindow
    stamp_ns: int

    def stamped(self, prediction: Prediction) -> Prediction:
        """The prediction under the observation's stamp, its times counted from there."""
        delay_s = (self.window.stamp_ns - self.stamp_ns) * 1e-9
        if delay_s == 0.0:
            return prediction
        return dataclasses.replace(
            prediction, stamp_ns=self.stamp_ns, time_s=prediction.time_s + delay_s
        )


class Intake:
    """Feeds the history and decides which observations start a prediction.

    Args:
        history: takes the observations in.
        predictor: forgets its graphs when the past is forgotten.
        statistics: where odd input is counted.
        parameters: those that count at first.
    """

    def __init__(
        self,
        history: TrackHistory,
        predictor: ScenePredictor,
        statistics: Statistics,
        parameters: PredictorParameters,
    ) -> None:
        self._history = history
        self._predictor = predictor
        self._statistics = statistics
        self._parameters = parameters
        self._schedule = Schedule(parameters.rate)
        self._ahead = 0
        self._newest_ns: int | None = None

    def configure(self, parameters: PredictorParameters) -> None:
        """Take other parameters from the next observation on."""
        if parameters.rate != self._parameters.rate:
            self._schedule = Schedule(parameters.rate)
        self._parameters = parameters

    def clock_jumped_back(self, now_ns: int) -> None:
        """The node's clock was set back to ``now_ns``: forget what lies after it."""
        tolerance_ns = round(self._parameters.stamp_tolerance * 1e9)
        if self._newest_ns is not None and self._newest_ns > now_ns + tolerance_ns:
            self._statistics.count("clock_reset")
            self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._history.clear()
        self._predictor.reset()
        self._schedule.reset()
        self._newest_ns = None
        self._ahead = 0

    def take(self, states: TrackedStates, now_ns: int) -> Work | None:
        """Take an observation into the history.

        Args:
            states: in the fixed frame.
            now_ns: the node's time (ns), 0 while it has none.

        Returns:
            The work that the observation starts, None where none is due.
        """
        if states.stamp_ns == 0:
            self._statistics.count("unstamped")
            return None
        if self._from_the_future(states.stamp_ns, now_ns):
            return None
        report = self._history.update(states)
        for name in _COUNTED:
            self._statistics.count(name, int(getattr(report, name)))
        unknown = int(np.count_nonzero(states.agent_class == 0))
        self._statistics.count("unknown_class", unknown)
        if report.frame_changed and not report.accepted:
            return None
        if report.clock_reset or report.frame_changed:
            self._schedule.reset()
            self._newest_ns = None
        self._newest_ns = max(states.stamp_ns, self._newest_ns or 0)
        if not self._schedule.due(states.stamp_ns):
            return None
        start_ns = states.stamp_ns + self._delay_ns(states.stamp_ns, now_ns)
        return Work(self._history.window(start_ns), states.stamp_ns)

    def _from_the_future(self, stamp_ns: int, now_ns: int) -> bool:
        """Whether to drop an observation because of a stamp ahead of the clock.

        One such stamp would make all that follow look old. A stream that stays ahead has another
        clock than the node: it is served, and counted.
        """
        tolerance_ns = round(self._parameters.stamp_tolerance * 1e9)
        if now_ns == 0 or stamp_ns <= now_ns + tolerance_ns:
            self._ahead = 0
            return False
        self._statistics.count("future_stamp")
        self._ahead += 1
        return self._ahead < _PATIENCE

    def _delay_ns(self, stamp_ns: int, now_ns: int) -> int:
        """How far after the observation the horizon starts (ns)."""
        if not self._parameters.delay_compensation or now_ns == 0:
            return 0
        delay_ns = now_ns - stamp_ns
        if delay_ns > round(LONGEST_DELAY_S * 1e9):
            self._statistics.count("delay_not_compensated")
            return 0
        return max(0, delay_ns)
