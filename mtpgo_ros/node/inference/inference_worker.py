# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inference on its own thread: the newest request first, and an answer within the budget.

The worker runs the model on the newest request; a request that still waits when a newer one comes
is skipped, not queued, except for a moment in which the process itself is held up. The watchdog
answers a request whose budget is used up with the fallback.
Both claim a request before they answer it (see ``prediction_request``), so each is answered once,
and a result that comes too late is dropped.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from mtpgo_core.schema import HistoryWindow, Prediction
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.inference.deadline_watchdog import DeadlineWatchdog
from mtpgo_ros.node.inference.prediction_request import PredictionRequest

_LONGEST_QUEUE = 64
"""Most requests that wait while none is to be skipped; chosen: a second at the highest rate."""


class InferenceWorker:
    """The worker and its watchdog; start it once, submit requests, stop it once.

    Args:
        predict: the model; called on the worker's thread only.
        fallback: the quick answer to a request over its budget or to a failure of the model;
            called on either thread.
        publish: publishes an answer; called on either thread.
        events: where skipped, late and failed cycles are counted.

    Attributes:
        skips: a newer request replaces those that wait; false: they are answered in their order.
    """

    def __init__(
        self,
        predict: Callable[[HistoryWindow], Prediction],
        fallback: Callable[[HistoryWindow], Prediction],
        publish: Callable[[PredictionRequest, Prediction], None],
        events: EventLog,
    ) -> None:
        self._predict, self._fallback, self._publish = predict, fallback, publish
        self._events = events
        self._watchdog = DeadlineWatchdog(self._answer_overdue)
        self._condition = threading.Condition()
        self.skips = True
        self._waiting: deque[PredictionRequest] = deque()
        self._running: PredictionRequest | None = None
        self._stopped = False
        # A daemon: a model that never returns must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name="inference", daemon=True)

    def start(self) -> None:
        """Start both threads."""
        self._watchdog.start()
        self._thread.start()

    def submit(self, request: PredictionRequest) -> None:
        """Make ``request`` the next one to run, instead of those that still wait."""
        request.submitted_ns = time.monotonic_ns()
        longest = 0 if self.skips else _LONGEST_QUEUE - 1
        with self._condition:
            surplus = max(0, len(self._waiting) - longest)
            replaced = [self._waiting.popleft() for _ in range(surplus)]
            self._waiting.append(request)
            self._condition.notify()
        for one in replaced:
            if one.claim():
                self._events.count("cycles_skipped")
        self._watchdog.watch(request)

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Answer no more requests; return true if both threads have ended within ``timeout_s``."""
        end_s = time.monotonic() + timeout_s
        with self._condition:
            self._stopped = True
            for request in (*self._waiting, self._running):
                if request is not None:
                    request.claim()
            self._waiting.clear()
            self._condition.notify()
        watchdog_ended = self._watchdog.stop(timeout_s)
        self._thread.join(max(0.0, end_s - time.monotonic()))
        return watchdog_ended and not self._thread.is_alive()

    def _run(self) -> None:
        while (request := self._take_next()) is not None:
            self._answer(request)

    def _take_next(self) -> PredictionRequest | None:
        """Wait for an unanswered request and take it; return None once stopped."""
        with self._condition:
            self._running = None
            while not self._stopped:
                if not self._waiting:
                    self._condition.wait()
                    continue
                request = self._waiting.popleft()
                if not request.claimed:
                    self._running = request
                    return request
        return None

    def _answer(self, request: PredictionRequest) -> None:
        prediction = None
        computed_ns = time.thread_time_ns()
        request.begun_ns = time.monotonic_ns()
        try:
            prediction = self._predict(request.window)
        except Exception as error:
            self._events.failure(
                "the model failed, constant velocity serves", error, "model_failures"
            )
        request.computed_ns = time.thread_time_ns() - computed_ns
        request.predicted_ns = time.monotonic_ns()
        if not request.claim():
            self._events.count("late_results_dropped")
        elif prediction is not None:
            self._publish_answer(request, prediction)
        else:
            self._answer_with_fallback(request)

    def _answer_overdue(self, request: PredictionRequest) -> None:
        """Answer a request that the watchdog has claimed."""
        request.over_budget = True
        self._events.count("over_budget")
        self._answer_with_fallback(request)

    def _answer_with_fallback(self, request: PredictionRequest) -> None:
        try:
            prediction = self._fallback(request.window)
        except Exception as error:
            self._events.failure(
                "the fallback failed, this cycle has no prediction", error, "cycles_failed"
            )
        else:
            self._publish_answer(request, prediction)

    def _publish_answer(self, request: PredictionRequest, prediction: Prediction) -> None:
        try:
            self._publish(request, prediction)
        except Exception as error:
            self._events.failure("the prediction could not be published", error, "cycles_failed")
