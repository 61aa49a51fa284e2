# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When the system clock was set, by clocks that the test sets."""

import threading

import pytest

from mtpgo_ros.runtime.clock_watch import ClockSteps, EvenClock, set_sentence, watched_clock

S_NS = 1_000_000_000


@pytest.mark.parametrize("by_ns", [-3600 * S_NS, -S_NS // 5, S_NS // 5, 3600 * S_NS])
def test_a_step_is_reported_once(clocks, by_ns):
    steps = ClockSteps()
    clocks.pass_time(0.1)
    assert steps.change_ns() == 0
    clocks.system_ns += by_ns
    clocks.pass_time(0.1)
    assert steps.change_ns() == by_ns
    clocks.pass_time(0.1)
    assert steps.change_ns() == 0


def test_an_adjusted_rate_is_no_step(clocks):
    steps = ClockSteps()
    for _ in range(10_000):  # half a second in all
        clocks.pass_time(0.1, rate=1.0005)
        assert steps.change_ns() == 0


def test_clocks_that_could_not_be_read_together_are_read_at_the_next_look(clocks):
    steps, clocks.late_ns = ClockSteps(), S_NS // 2
    clocks.system_ns += 10 * S_NS
    assert steps.change_ns() == 0
    clocks.late_ns = 0
    assert steps.change_ns() == 10 * S_NS


@pytest.mark.parametrize("by_ns", [-3600 * S_NS, 3600 * S_NS])
def test_an_even_clock_ignores_steps_of_the_system_clock(clocks, by_ns):
    even, begin_ns = EvenClock(), clocks.system_ns
    clocks.pass_time(1.0)
    clocks.system_ns += by_ns
    assert even.time_ns() == begin_ns + S_NS
    clocks.pass_time(2.0)
    assert even.time_ns() == begin_ns + 3 * S_NS


def test_a_watched_clock_tells_of_a_step_and_tells_again(clocks):
    heard, repeated = [], threading.Semaphore(0)
    with watched_clock(heard.append, repeated.release):
        clocks.system_ns -= 2 * S_NS
        for _ in range(3):
            assert repeated.acquire(timeout=60.0)
    assert heard == [-2.0]


def test_the_sentence_says_which_way_and_by_how_much():
    assert set_sentence(-3600.04) == "the machine's clock was set back by 3600.0 s"
    assert set_sentence(0.31) == "the machine's clock was set forward by 0.3 s"
