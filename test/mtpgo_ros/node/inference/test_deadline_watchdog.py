# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The watchdog answers exactly the requests that are overdue and unclaimed."""

import queue
import time

import pytest

from mtpgo_ros.node.inference.deadline_watchdog import DeadlineWatchdog
from mtpgo_ros.node.inference.prediction_request import PredictionRequest

LIMIT_S = 30.0


def request(name, budget_s):
    budget_ns = round(budget_s * 1e9)
    return PredictionRequest(name, 0, time.monotonic_ns(), budget_ns, 2 * budget_ns)


@pytest.fixture
def overdue():
    return queue.Queue()


@pytest.fixture
def watchdog(overdue):
    one = DeadlineWatchdog(overdue.put)
    one.start()
    yield one
    assert one.stop(LIMIT_S)


def test_an_overdue_request_is_claimed_not_before_its_budget_ends(watchdog, overdue):
    one = request("a", 0.02)
    watchdog.watch(one)
    assert overdue.get(timeout=LIMIT_S) is one
    assert time.monotonic_ns() >= one.due_ns
    assert one.claimed


def test_requests_are_answered_in_the_order_of_their_deadlines(overdue):
    watchdog = DeadlineWatchdog(overdue.put)
    late, soon = request("late", 0.2), request("soon", 0.001)
    watchdog.watch(late)
    watchdog.watch(soon)
    watchdog.start()  # with both known, however long that took
    assert overdue.get(timeout=LIMIT_S) is soon
    assert overdue.get(timeout=LIMIT_S) is late
    assert watchdog.stop(LIMIT_S)


def test_a_claimed_request_is_left_alone(watchdog, overdue):
    answered, other = request("answered", 0.001), request("other", 0.02)
    assert answered.claim()
    watchdog.watch(answered)
    watchdog.watch(other)
    assert overdue.get(timeout=LIMIT_S) is other
    assert overdue.empty()


def test_after_the_stop_nothing_is_claimed(overdue):
    watchdog = DeadlineWatchdog(overdue.put)
    watchdog.start()
    one = request("a", 60.0)
    watchdog.watch(one)
    assert watchdog.stop(LIMIT_S)
    assert not one.claimed
    assert overdue.empty()
