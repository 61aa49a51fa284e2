# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counters and throttled log lines, by a clock that the test sets."""

import threading

import pytest
from ros_helpers import RecordingLogger

from mtpgo_ros.diagnostics.event_log import LONGEST_TEXT, RECENT_S, REPEAT_S, EventLog


class ManualClock:
    """A clock that the test moves."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def logger():
    return RecordingLogger()


def test_counters_are_recent_for_a_while(clock):
    events = EventLog(clock=clock)
    events.count("late", 3)
    events.count("late", 2)
    events.count("never", 0)
    assert events.counts() == {"late": 5}
    descriptions = {"late": "objects too old", "never": "x"}
    clock.now += RECENT_S
    assert events.recent(descriptions) == ["objects too old (5 in all)"]
    clock.now += 0.01
    assert events.recent(descriptions) == []
    events.reset()
    assert events.counts() == {}


def test_a_counter_logs_its_description_or_the_reason(logger, clock):
    events = EventLog(logger, clock)
    events.count("late", 3)
    events.count("late", 2)  # counted, but within the time in which its line is not repeated
    events.count("malformed", 0, "not logged")
    events.count("malformed", reason="message left out: no field x")
    events.count("qos_incompatible", reason="cannot be heard", is_error=True)
    events.count("messages")  # nothing unusual: no line
    assert logger.warnings == [
        "objects older than what is known: 3",
        "message left out: no field x",
    ]
    assert logger.errors == ["cannot be heard"]
    assert events.counts() == {"late": 5, "malformed": 1, "qos_incompatible": 1, "messages": 1}


def test_the_detail_of_the_last_case_follows_the_description(logger, clock):
    events = EventLog(logger, clock)
    events.count("skipped_objects", 15, detail="marker of type 2")
    events.count("skipped_objects", 2, detail="marker of type 9")
    description = "objects that could not be read"
    assert logger.warnings == [f"{description} (marker of type 2): 15"]
    assert events.recent({"skipped_objects": description}) == [
        f"{description} (marker of type 9; 17 in all)"
    ]


def test_a_failure_is_one_line_and_counted_where_it_has_a_counter(logger, clock):
    events = EventLog(logger, clock)
    events.failure("the model failed", ValueError("no\n  good"), "model_failures")
    events.failure("a callback failed", KeyError())
    assert logger.warnings == [
        "the model failed: ValueError: no good",
        "a callback failed: KeyError: no message",
    ]
    assert events.counts() == {"model_failures": 1}


def test_counting_from_many_threads_loses_nothing():
    events = EventLog()

    def count():
        for _ in range(2000):
            events.count("x")

    threads = [threading.Thread(target=count) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert events.counts() == {"x": 8000}


def test_lines_of_a_kind_are_logged_once_in_a_while(logger, clock):
    events = EventLog(logger, clock)
    events.log("a", "one")
    events.log("a", "two")
    events.log("b", "three")
    clock.now += REPEAT_S
    events.log("a", "four")
    assert logger.warnings == ["one", "three", "four (1 more since)"]


def test_the_numbers_in_the_log_add_up_to_the_counter(logger, clock):
    events = EventLog(logger, clock)
    for _ in range(39):
        events.count("late")
    clock.now += REPEAT_S
    events.count("late", 2)
    events.count("late", 3)
    assert logger.warnings == [
        "objects older than what is known: 1",
        "objects older than what is known: 40",
    ]
    events.flush()  # too early
    clock.now += REPEAT_S
    events.flush()
    events.flush()  # nothing is left
    assert logger.warnings[2:] == ["objects older than what is known: 3"]
    assert events.counts() == {"late": 44}


def test_swallowed_reasons_are_reported_when_the_fault_has_ended(logger, clock):
    events = EventLog(logger, clock)
    for number in range(39):
        events.count("malformed", reason=f"message {number} left out", is_error=True)
    clock.now += REPEAT_S
    events.flush()
    assert logger.errors == ["message 0 left out", "message 38 left out (38 more since)"]


def test_a_line_as_long_as_a_message_is_cut_off(logger, clock):
    EventLog(logger, clock).count("malformed", reason="field " + "x" * 1_000_000)
    (line,) = logger.warnings
    assert line.endswith("... (1000006 characters)")
    assert len(line) < LONGEST_TEXT + 100
