# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps, rates and clocks as no tracker should have them, over real DDS."""

import dataclasses
import time

import pytest
from fault_harness import ERROR, FORGOTTEN_S, OK, WARN
from fault_tools import (
    HealthListener,
    Resources,
    SimulatedClock,
    set_parameters,
    sources,
)
from ros_helpers import START_NS, message_of, traffic

from mtpgo_core.identity import keys_from_integers


@pytest.fixture(scope="module")
def node(start_predictor):
    """The predictor of this module, which must have the same threads and memory at its end."""
    node = start_predictor()
    node.healthy(steps=3)
    before = Resources(node)
    yield node
    node.healthy()
    before.check()


@pytest.fixture(scope="module")
def simulated(start_predictor):
    """A predictor with simulated time and a short patience."""
    return start_predictor(use_sim_time=True, input_timeout=0.3)


ATTEMPTS = 3
"""What a pause of the machine may spoil is tried so often; what is wrong is wrong each time."""


def stamped(states, stamp_ns):
    """Return the states with another stamp (ns)."""
    return dataclasses.replace(states, stamp_ns=stamp_ns)


def test_a_tenth_of_a_hertz(node):
    for _ in range(3):
        node.fresh().healthy()


def stamps_at_200_hertz(node):
    """Return the stamps of the predictions in a second with 200 observations."""
    node.fresh().healthy()
    first, begin_s = len(node.answers), node.time_s
    for step in range(1, 201):
        node.send(traffic(begin_s + 0.005 * step))
        node.spin()
        time.sleep(0.003)
    node.time_s = begin_s + 1.0
    node.healthy()
    sources(node, first)
    return [a.prediction.stamp_ns for a in node.answers[first:]]


def test_200_hertz(node):
    # Of a stream that waits for a node whose machine pauses, all but the newest are lost.
    for _ in range(ATTEMPTS):
        stamps = stamps_at_200_hertz(node)
        assert stamps == sorted(stamps)
        assert len(stamps) <= 8  # five a second, whatever comes
        if len(stamps) >= 4:
            return
    pytest.fail(f"of a second at 200 Hz only {len(stamps)} predictions came, each time")


def test_jitter(node):
    node.fresh().healthy()
    for offset_s in (0.07, -0.06, 0.05, -0.07, 0.0):
        steady_s = node.time_s + 0.2
        node.time_s = steady_s + offset_s - 0.2
        states = node.states()
        node.send(states)
        node.time_s = steady_s
    node.healthy()
    for answer in node.answers[-3:]:
        reached = traffic((answer.prediction.stamp_ns - START_NS) * 1e-9)
        node.check(answer.prediction, reached)


def test_a_burst_of_200(node):
    node.fresh().healthy()
    first = len(node.answers)
    for step in range(1, 201):
        node.send(traffic(node.time_s + 0.02 * step))
    node.time_s += 4.0
    node.healthy(steps=2)
    stamps = [a.prediction.stamp_ns for a in node.answers[first:]]
    assert stamps == sorted(set(stamps))
    sources(node, first)


def test_a_stamp_of_zero(node):
    node.fresh().healthy()
    with node.counts(unstamped=1):
        node.send(stamped(node.states(), 0))
    node.healthy()
    assert node.said("input", WARN, "without a stamp")


def test_a_negative_stamp(node):
    node.fresh().healthy(steps=3)
    message = message_of(node.states())
    message.header.stamp.sec = -5
    with node.counts(unstamped=1, clock_reset=0):
        node.send(message)
    node.healthy()


def test_the_largest_stamp(node):
    node.fresh().healthy()
    message = message_of(node.states())
    message.header.stamp.sec, message.header.stamp.nanosec = 2**31 - 1, 999_999_999
    with node.counts(future_stamp=1, clock_reset=0):
        node.send(message)
    node.healthy()


def test_a_stamp_from_the_future(node):
    node.fresh().healthy()
    with node.counts(future_stamp=1, clock_reset=0):
        node.send(stamped(node.states(), time.time_ns() + 3600 * 10**9))
    node.healthy()
    assert node.said("input", WARN, "ahead of the clock")


def test_microseconds_in_the_field_of_nanoseconds(node):
    node.fresh().healthy()
    begin_s = round(node.time_s) + FORGOTTEN_S
    for step in range(50):
        seconds, tenth = divmod(step, 10)
        states = traffic(begin_s + step / 10)
        node.send(stamped(states, START_NS + round((begin_s + seconds + tenth * 1e-4) * 1e9)))
        node.spin_for(0.02)
    node.until(lambda: node.said("input", WARN, "microseconds"), "a word on the unit")
    assert node.counter("stamp_unit") > 0
    node.time_s = begin_s + 5.0
    node.healthy(steps=2)
    node.level_while_healthy("input", OK)


def test_stamps_that_hardly_advance(node):
    node.fresh().healthy()
    first, begin_s = len(node.answers), node.time_s

    def noticed():
        """Send an observation with the milliseconds since the last one in place of seconds."""
        node.time_s += 1e-4
        node.send(traffic(node.time_s))
        node.spin_for(0.1)
        return node.said("input", WARN, "less than a hundredth as fast as the clock")

    node.until(noticed, "a word on the pace")
    assert len(node.answers) == first
    node.time_s = begin_s + 1.0
    node.level_while_healthy("input", OK)


def test_a_stamp_twice(node):
    node.fresh().healthy()
    with node.counts(duplicates=4):
        node.send(traffic(node.time_s))
    node.healthy()
    assert node.said("input", WARN, "repeated stamp")


def test_an_older_stamp(node):
    node.fresh().healthy(steps=2)
    with node.counts(late=4, clock_reset=0):
        node.send(traffic(node.time_s - 0.2 - 0.1))
    node.healthy()


def test_stamps_out_of_order(node):
    node.fresh().healthy()
    begin_s = node.time_s
    with node.counts(late=8, clock_reset=0):
        for step in (2, 1, 4, 3):
            node.send(traffic(begin_s + 0.2 * step))
    node.time_s = begin_s + 0.8
    node.healthy()
    assert node.said("input", WARN, "older than what is known")


def test_a_clock_that_jumps_back(node):
    node.fresh().healthy(steps=2)
    node.time_s -= 8.0
    with node.counts(clock_reset=1):
        node.healthy()
    node.time_s += 8.0
    assert node.said("input", WARN, "backwards")


def test_two_publishers_whose_clocks_differ_by_more_than_the_history(node):
    node.fresh().healthy()
    node.time_s += 100.0  # no earlier jump of the clock counts any more
    node.healthy(steps=2)
    first = len(node.answers)
    with node.counts(clock_reset=1, behind=27):
        for _ in range(10):
            newest = node.states()
            node.predict(newest)
            behind = traffic(node.time_s - 5.0, 3)
            node.send(dataclasses.replace(behind, key=keys_from_integers(range(101, 104))))
    # All with the later clock, and the one of the jump: the rate is kept.
    assert len(node.answers) - first <= 11
    node.healthy()
    assert node.said("input", WARN, "two publishers with different clocks")


def test_a_clock_that_jumps_forward(node):
    node.fresh().healthy()
    node.time_s += 3600.0
    with node.counts(clock_reset=0, clock_set=0, restarted=0):
        node.healthy(steps=2)


def test_use_sim_time_switched_while_running(node):
    node.fresh().healthy(steps=2)
    with node.counts(clock_reset=0):
        assert set_parameters(node, use_sim_time=True)[0].successful
        node.healthy(steps=2)
        node.level_while_healthy("input", WARN, "no time has come on /clock")
        assert set_parameters(node, use_sim_time=False)[0].successful
        node.healthy(steps=2)
    node.level_while_healthy("input", OK)


def test_simulated_time_without_a_clock(simulated):
    node = simulated
    node.healthy(steps=2)  # stamps are used as they are
    node.level_while_healthy("input", WARN, "no time has come on /clock")
    node.level("input", ERROR, "stale")  # on the machine's clock, since there is no other
    node.level_while_healthy("input", WARN)


def test_simulated_time_that_is_paused(simulated):
    node, health = simulated, HealthListener(simulated)
    clock = SimulatedClock(node)
    node.fresh().healthy()
    clock.set(node.time_s)
    node.level_while_healthy("input", WARN, "stood still")
    node.level("input", ERROR, "stale")
    health.becomes(ERROR, "stale")

    def runs_on():
        clock.show(node.time_s)
        node.healthy()
        return node.statuses["input"].level == OK

    node.until(runs_on)
    node.until(lambda: runs_on() and health.heard[-1].level == OK)


def levels_with_a_slow_clock(node, clock):
    """Return the levels of the input in 1.5 s in which the simulation goes on by 0.15 s.

    These are five timeouts of the machine's time, half a one of the simulation's.
    """
    begin_s = node.fresh().time_s
    clock.set(begin_s)
    node.level_while_healthy("input", OK)
    clock_s = 0.1 * time.monotonic()
    end_s, seen = time.monotonic() + 1.5, []

    def slowly():
        clock.show(begin_s + 0.1 * time.monotonic() - clock_s)
        seen.append(node.statuses["input"].level)
        return time.monotonic() > end_s

    node.until(slowly)
    return seen


def test_a_slow_clock(simulated):
    clock = SimulatedClock(simulated)
    # While the machine pauses, this clock stands still, which is said rightly.
    assert any(ERROR not in levels_with_a_slow_clock(simulated, clock) for _ in range(ATTEMPTS)), (
        "the input is stale on the machine's clock, each time"
    )
    simulated.healthy()
