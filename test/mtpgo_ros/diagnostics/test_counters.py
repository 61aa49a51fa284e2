# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counters, latencies, throttled log lines, and what the diagnostics make of them."""

import math
import threading

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_ros.diagnostics.counters import RECENT_S, Statistics
from mtpgo_ros.diagnostics.diagnostic_status import Facts, statuses
from mtpgo_ros.diagnostics.throttled_log import Complaints
from mtpgo_ros.node.latest_only import LatestOnly

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class HandClock:
    """A clock that the test moves."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_counters_are_recent_for_a_while():
    clock, heard = HandClock(), []
    statistics = Statistics(lambda name, number: heard.append((name, number)), clock)
    statistics.count("late", 3)
    statistics.count("late", 2)
    statistics.count("never", 0)
    assert statistics.counts() == {"late": 5}
    assert heard == [("late", 3), ("late", 2)]
    wording = {"late": "objects too old", "never": "x"}
    clock.now += RECENT_S
    assert statistics.recent(wording) == ["objects too old (5 in all)"]
    clock.now += 0.01
    assert statistics.recent(wording) == []


def test_counting_from_many_threads_loses_nothing():
    statistics = Statistics()

    def count():
        for _ in range(2000):
            statistics.count("x")

    threads = [threading.Thread(target=count) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert statistics.counts() == {"x": 8000}


def test_latency_percentiles_by_hand():
    statistics = Statistics()
    assert math.isnan(statistics.latency().p50)
    assert math.isnan(statistics.latency().maximum)
    for value in range(101):
        statistics.measured(float(value))
    latency = statistics.latency()
    assert (latency.p50, latency.p99, latency.maximum) == pytest.approx((50.0, 99.0, 100.0))
    for _ in range(600):  # the window moves on, the maximum stays
        statistics.measured(1.0)
    latency = statistics.latency()
    assert (latency.p50, latency.p99, latency.maximum) == (1.0, 1.0, 100.0)


def test_complaints_of_a_kind_are_logged_once_in_a_while():
    clock, lines = HandClock(), []
    complain = Complaints(lines.append, repeat_s=5.0, clock=clock)
    complain("a", "one")
    complain("a", "two")
    complain("b", "three")
    clock.now += 5.0
    complain("a", "four")
    assert lines == ["one", "three", "four"]


def test_latest_only_lets_older_items_go():
    handled, entered, go = [], threading.Semaphore(0), threading.Semaphore(0)

    def handle(item):
        entered.release()
        assert go.acquire(timeout=30.0)
        handled.append(item)

    latest = LatestOnly(handle, "test")
    latest.submit(1)
    assert entered.acquire(timeout=30.0)
    for item in (2, 3, 4):
        latest.submit(item)
    go.release(2)
    assert entered.acquire(timeout=30.0)
    assert latest.stop(30.0)
    assert handled == [1, 4]


def levels(facts, statistics):
    return [status.level for status in statuses("predictor", facts, statistics)]


def test_levels_of_the_three_statuses():
    facts = Facts(topic="/objects", waiting="the node is not active")
    statistics = Statistics()
    assert levels(facts, statistics) == [WARN, OK, OK]
    facts.waiting = ""
    assert levels(facts, statistics) == [WARN, OK, OK]  # nothing has come yet
    facts.input_age_s = 0.1
    assert levels(facts, statistics) == [OK, OK, OK]
    facts.input_age_s = 1.1
    assert levels(facts, statistics) == [ERROR, OK, OK]
    facts.input_age_s, facts.frame_error = 0.1, "no odometry"
    assert levels(facts, statistics) == [ERROR, OK, OK]
    facts.frame_error = ""
    statistics.count("late")
    statistics.count("cycles_skipped")
    assert levels(facts, statistics) == [WARN, OK, WARN]
    facts.over_budget_in_a_row = 3
    assert levels(facts, statistics) == [WARN, OK, ERROR]
    facts.fallback_agents = 1
    assert levels(facts, statistics)[1] == WARN
    facts.degraded = "no file"
    assert levels(facts, statistics)[1] == ERROR


def test_every_counter_is_reported_from_the_start():
    found = statuses("predictor", Facts(), Statistics())
    assert [status.name for status in found] == [
        "predictor: input",
        "predictor: model",
        "predictor: timing",
    ]
    values = {pair.key: pair.value for status in found for pair in status.values}
    for name in ("messages", "late", "clock_reset", "deadline_misses", "model_failures"):
        assert values[name] == "0"
