# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The worker and its watchdog, with a model that the test releases step by step."""

import threading
import time
from collections import Counter

import pytest

from mtpgo_ros.node.inference.inference_worker import InferenceWorker
from mtpgo_ros.node.inference.prediction_request import PredictionRequest

LONG_NS = 60_000_000_000
ENOUGH_NS = 1_000_000_000
"""A budget in which the model begins, but does not end before it is released (ns)."""

LIMIT_S = 30.0


class Events:
    """Counts events and wakes those that wait for them."""

    def __init__(self):
        self.counts, self.failures = Counter(), []
        self.changed = threading.Condition()

    def count(self, name):
        with self.changed:
            self.counts[name] += 1
            self.changed.notify_all()

    def failure(self, what, error, counter):
        self.failures.append((what, str(error)))
        self.count(counter)


class Scene:
    """A worker whose model waits until it is released, request by request."""

    def __init__(self):
        self.published, self.events = [], Events()
        self.counts, self.failures = self.events.counts, self.events.failures
        self.begun, self.go = threading.Semaphore(0), threading.Semaphore(0)
        self.event = self.events.changed
        self.broken = False
        self.worker = InferenceWorker(self.predict, self.fallback, self.publish, self.events)
        self.worker.start()

    def predict(self, name):
        self.begun.release()
        assert self.go.acquire(timeout=LIMIT_S)
        if name == "bad":
            raise ValueError("no good")
        return f"model {name}"

    def fallback(self, name):
        if self.broken:
            raise ValueError("broken too")
        return f"fallback {name}"

    def publish(self, request, answer):
        with self.event:
            self.published.append(answer)
            self.event.notify_all()

    def submit(self, name, budget_ns=LONG_NS):
        self.worker.submit(
            PredictionRequest(name, 0, time.monotonic_ns(), budget_ns, 2 * budget_ns)
        )

    def until(self, condition):
        with self.event:
            assert self.event.wait_for(condition, LIMIT_S)


@pytest.fixture
def scene():
    one = Scene()
    yield one
    one.go.release(100)
    assert one.worker.stop(LIMIT_S)


def test_an_answer_in_time_comes_from_the_model(scene):
    scene.submit("a")
    scene.go.release()
    scene.until(lambda: scene.published == ["model a"])
    assert not scene.counts


def test_of_the_waiting_requests_only_the_newest_is_run(scene):
    scene.submit("a")
    assert scene.begun.acquire(timeout=LIMIT_S)  # the model holds a
    scene.submit("b")
    scene.submit("c")
    scene.submit("d")
    scene.go.release(2)
    scene.until(lambda: scene.published == ["model a", "model d"])
    assert scene.counts == {"cycles_skipped": 2}


def test_while_none_is_to_be_skipped_the_waiting_ones_are_answered_in_order(scene):
    scene.worker.skips = False
    scene.submit("first")
    assert scene.begun.acquire(timeout=LIMIT_S)
    for name in ("second", "third", "fourth"):
        scene.submit(name)
    scene.go.release(4)
    scene.until(lambda: len(scene.published) == 4)
    assert scene.published == ["model first", "model second", "model third", "model fourth"]
    assert not scene.counts


def test_over_budget_the_fallback_answers_and_the_late_result_is_dropped(scene):
    scene.submit("a", budget_ns=ENOUGH_NS)
    scene.until(lambda: scene.published == ["fallback a"])
    scene.go.release()
    scene.until(lambda: scene.counts["late_results_dropped"] == 1)
    assert scene.published == ["fallback a"]
    assert scene.counts == {"over_budget": 1, "late_results_dropped": 1}


def test_a_request_that_waits_behind_a_stuck_model_is_answered_too(scene):
    scene.submit("a", budget_ns=ENOUGH_NS)
    scene.until(lambda: scene.published == ["fallback a"])
    scene.submit("b", budget_ns=1_000_000)
    scene.until(lambda: scene.published == ["fallback a", "fallback b"])
    scene.go.release()  # b was answered: the model is not run for it
    scene.until(lambda: scene.counts["late_results_dropped"] == 1)
    scene.submit("c")
    scene.go.release()
    scene.until(lambda: scene.published[-1] == "model c")
    assert scene.counts == {"over_budget": 2, "late_results_dropped": 1}


def test_the_fallback_answers_for_a_failing_model(scene):
    scene.submit("bad")
    scene.go.release()
    scene.until(lambda: scene.published == ["fallback bad"])
    assert scene.counts == {"model_failures": 1}
    assert scene.failures[0][1] == "no good"
    scene.submit("a")
    scene.go.release()
    scene.until(lambda: scene.published[-1] == "model a")


def test_a_failing_fallback_does_not_end_the_threads(scene):
    scene.broken = True
    scene.submit("bad")
    scene.go.release()
    scene.until(lambda: scene.counts["cycles_failed"] == 1)
    scene.submit("x", budget_ns=1_000_000)
    scene.until(lambda: scene.counts["cycles_failed"] == 2)
    scene.go.release()
    scene.until(lambda: scene.counts["late_results_dropped"] == 1)
    scene.submit("a")
    scene.go.release()
    scene.until(lambda: scene.published == ["model a"])


def test_stopping_says_whether_the_model_still_runs(scene):
    scene.submit("a")
    assert scene.begun.acquire(timeout=LIMIT_S)
    assert not scene.worker.stop(timeout_s=0.01)
    scene.go.release()
    assert scene.worker.stop(LIMIT_S)
    assert not scene.published  # a result after the stop is not published


@pytest.mark.parametrize("seed", range(3))
def test_every_request_is_answered_once_or_skipped(seed):
    """Budgets as long as the work: worker and watchdog race for every answer."""
    answers, events = Counter(), Events()
    counts, lock = events.counts, events.changed

    def publish(request, answer):
        with lock:
            answers[request.window] += 1

    def predict(name):
        time.sleep(0.001)
        return name

    worker = InferenceWorker(predict, lambda name: name, publish, events)
    worker.start()
    for name in range(200):
        budget_ns = 1_000_000 + 50_000 * seed
        worker.submit(PredictionRequest(name, 0, time.monotonic_ns(), budget_ns, LONG_NS))
        time.sleep(0.0005 * (1 + name % 4))
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        with lock:
            if sum(answers.values()) + counts["cycles_skipped"] >= 200:
                break
        time.sleep(0.001)
    assert worker.stop(LIMIT_S)
    assert set(answers.values()) == {1}
    assert sum(answers.values()) + counts["cycles_skipped"] == 200


def test_a_request_knows_the_times_that_it_has_been_through(scene):
    request = PredictionRequest("one", 0, time.monotonic_ns(), LONG_NS, 2 * LONG_NS)
    scene.worker.submit(request)
    scene.go.release()
    scene.until(lambda: scene.published)
    times = (request.received_ns, request.submitted_ns, request.begun_ns, request.predicted_ns)
    assert list(times) == sorted(times)
    assert 0 <= request.computed_ns <= time.monotonic_ns() - request.begun_ns
