# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inference beside the subscription: one worker, the newest state, a deadline for each answer.

Two threads share a slot of one job. The worker takes the newest job and runs the model; a job
still waiting when a newer one comes is skipped, never queued. The watchdog answers a job whose
budget is used up with the fallback. Whoever claims a job first answers it, so each is answered
once, and a result that comes too late is dropped.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

Input = TypeVar("Input")
Answer = TypeVar("Answer")


@dataclass(eq=False)
class Job(Generic[Input]):
    """One state to be predicted from.

    Attributes:
        input: what the model gets.
        received_ns: when the observation came (ns of the monotonic clock).
        budget_ns: time after ``received_ns`` at which the fallback answers (ns).
        deadline_ns: time after ``received_ns`` at which an answer is too late (ns).
        claimed: somebody answers it, or nobody will.
        over_budget: the fallback answers it because the model was not ready.
    """

    input: Input
    received_ns: int
    budget_ns: int
    deadline_ns: int
    claimed: bool = False
    over_budget: bool = False

    @property
    def due_ns(self) -> int:
        """When the fallback answers (ns of the monotonic clock)."""
        return self.received_ns + self.budget_ns


@dataclass(frozen=True)
class Hooks(Generic[Input, Answer]):
    """What the two threads call; none of them may block for long but ``predict``.

    Attributes:
        predict: the model, called on the worker thread only.
        fallback: the quick answer for a job over its budget or a model that failed, called on
            either thread.
        publish: gives an answer away, called on either thread.
        count: adds one to a named counter.
        failed: told of an exception, with what was being done.
    """

    predict: Callable[[Input], Answer]
    fallback: Callable[[Input], Answer]
    publish: Callable[[Job[Input], Answer], None]
    count: Callable[[str], None]
    failed: Callable[[str, Exception], None]


class InferenceWorker(Generic[Input, Answer]):
    """The worker and its watchdog; start it once, submit jobs, stop it once."""

    def __init__(self, hooks: Hooks[Input, Answer]) -> None:
        self._hooks = hooks
        self._condition = threading.Condition()
        self._waiting: Job[Input] | None = None
        self._running: Job[Input] | None = None
        self._stopped = False
        # Daemons: a model that never returns must not keep the process alive.
        self._threads = [
            threading.Thread(target=self._work, name="inference", daemon=True),
            threading.Thread(target=self._watch, name="watchdog", daemon=True),
        ]

    def start(self) -> None:
        """Start both threads."""
        for thread in self._threads:
            thread.start()

    def submit(self, job: Job[Input]) -> None:
        """Make ``job`` the next one to run, in the stead of one that still waits."""
        with self._condition:
            replaced, self._waiting = self._waiting, job
            if replaced is not None and self._claim(replaced):
                self._hooks.count("cycles_skipped")
            self._condition.notify_all()

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Answer no more jobs; true when both threads have ended within ``timeout_s``."""
        with self._condition:
            self._stopped = True
            for job in (self._waiting, self._running):
                if job is not None:
                    self._claim(job)
            self._waiting = None
            self._condition.notify_all()
        end = time.monotonic() + timeout_s
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, end - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)

    def _claim(self, job: Job[Input]) -> bool:
        """Take the right to answer ``job``; call with the lock held."""
        if job.claimed:
            return False
        job.claimed = True
        return True

    def _work(self) -> None:
        while True:
            with self._condition:
                while self._waiting is None and not self._stopped:
                    self._condition.wait()
                if self._stopped:
                    return
                job, self._waiting = self._waiting, None
                assert job is not None
                if job.claimed:
                    continue
                self._running = job
                self._condition.notify_all()
            self._run(job)

    def _run(self, job: Job[Input]) -> None:
        answer: Answer | None = None
        try:
            answer = self._hooks.predict(job.input)
        except Exception as error:
            self._hooks.count("model_failures")
            self._hooks.failed("the model failed, constant velocity serves", error)
        with self._condition:
            self._running = None
            mine = self._claim(job)
        if not mine:
            self._hooks.count("late_results_dropped")
        elif answer is not None:
            self._publish(job, answer)
        else:
            self._answer_with_fallback(job)

    def _watch(self) -> None:
        while True:
            with self._condition:
                if self._stopped:
                    return
                job = self._most_urgent()
                if job is None:
                    self._condition.wait()
                    continue
                left_ns = job.due_ns - time.monotonic_ns()
                if left_ns > 0:
                    self._condition.wait(left_ns * 1e-9)
                    continue
                job.over_budget = self._claim(job)
                if self._waiting is job:
                    self._waiting = None
            self._hooks.count("over_budget")
            self._answer_with_fallback(job)

    def _most_urgent(self) -> Job[Input] | None:
        """The unanswered job whose budget ends first; call with the lock held."""
        jobs = [j for j in (self._waiting, self._running) if j is not None and not j.claimed]
        return min(jobs, key=lambda job: job.due_ns, default=None)

    def _answer_with_fallback(self, job: Job[Input]) -> None:
        try:
            answer = self._hooks.fallback(job.input)
        except Exception as error:
            self._hooks.failed("the fallback failed, this cycle has no prediction", error)
            self._hooks.count("cycles_failed")
            return
        self._publish(job, answer)

    def _publish(self, job: Job[Input], answer: Answer) -> None:
        try:
            self._hooks.publish(job, answer)
        except Exception as error:
            self._hooks.count("cycles_failed")
            self._hooks.failed("the prediction could not be published", error)
