# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The timing of a playback, without ROS."""

import itertools
import time

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_ros.bags import playback
from mtpgo_ros.bags.playback import PlaybackTiming, Report, Sinks, play


class Tape:
    """Sinks that store what was published, with the time of each."""

    def __init__(self, limit=None):
        self.start = time.monotonic()
        self.messages, self.ticks, self.limit = [], [], limit

    def sinks(self):
        return Sinks(self.publish, self.clock, lambda _: None, self.stopped)

    def publish(self, topic, data):
        self.messages.append((topic, data, time.monotonic() - self.start))

    def clock(self, time_ns):
        self.ticks.append((time_ns, time.monotonic() - self.start))

    def stopped(self):
        return self.limit is not None and len(self.messages) >= self.limit


def numbered(count, step_ns=10_000_000):
    return ((f"/t{k % 2}", k * step_ns, bytes([k])) for k in range(count))


@pytest.mark.parametrize("rate", [1.0, 4.0])
def test_messages_and_ticks_come_at_their_own_times(rate):
    tape, report = Tape(), Report()
    play(numbered(41), PlaybackTiming(0, 400_000_000, rate, 100.0), tape.sinks(), report)
    assert [data[0] for _, data, _ in tape.messages] == list(range(41))
    assert report.messages == 41
    assert report.wall_s >= 0.4 / rate
    # Never early; how late depends on the machine and is reported.
    wall = np.array([when for _, _, when in tape.messages])
    late = wall - np.arange(41) * 0.01 / rate
    assert (late >= 0.0).all()
    assert (np.array(report.lateness_ms) <= 1e3 * late).all()
    assert report.percentiles()[2] == max(report.lateness_ms)
    # The clock counts the recording's time, from its start, 100 ticks a second of the wall clock.
    stamps = [time_ns for time_ns, _ in tape.ticks]
    assert stamps[0] == 0
    assert (np.diff(stamps) > 0).all()
    assert all(s % round(rate * 10_000_000) == 0 for s in stamps)
    assert all(when >= s * 1e-9 / rate for s, when in tape.ticks)


class LateClock:
    """A machine on which every sleep ends 4 ms late, and nothing else takes time."""

    def __init__(self):
        self.now_s = 100.0

    def monotonic(self):
        return self.now_s

    def sleep(self, duration_s):
        self.now_s += duration_s + 0.004


@pytest.mark.parametrize("rate", [0.5, 1.0])
def test_lateness_does_not_add_up(monkeypatch, rate):
    clock, report = LateClock(), Report()
    monkeypatch.setattr(playback, "time", clock)
    sinks = Sinks(lambda topic, data: None, lambda _: None, lambda _: None, lambda: False)
    play(numbered(41), PlaybackTiming(0, 400_000_000, rate), sinks, report)
    assert report.lateness_ms == pytest.approx([0.0, *40 * [4.0]], abs=1e-6)
    assert report.wall_s == pytest.approx(0.4 / rate + 0.004)


def test_a_tick_at_the_time_of_a_message_comes_first():
    tape, order = Tape(), []
    sinks = Sinks(
        lambda topic, data: order.append("message"),
        lambda time_ns: order.append("tick"),
        lambda _: None,
        tape.stopped,
    )
    play(iter([("/a", 0, b"")]), PlaybackTiming(0, 0), sinks, Report())
    assert order[:2] == ["tick", "message"]


def test_stopping_is_noticed_in_a_long_pause():
    tape = Tape(limit=1)
    messages = iter([("/a", 0, b""), ("/a", 3_600_000_000_000, b"")])
    report = Report()
    play(messages, PlaybackTiming(0, 3_600_000_000_000, clock_hz=0.0), tape.sinks(), report)
    assert len(tape.messages) == 1
    assert not tape.ticks
    assert report.wall_s < 30.0


def test_an_error_while_reading_ahead_is_raised():
    def broken():
        yield ("/a", 0, b"")
        raise RecordingError("cut off")

    tape = Tape()
    with pytest.raises(RecordingError, match="cut off"):
        play(broken(), PlaybackTiming(0, 10**9), tape.sinks(), Report())
    assert len(tape.messages) == 1


def test_the_read_ahead_thread_ends_with_the_pass():
    tape = Tape(limit=2)
    endless = (("/a", k, b"") for k in itertools.count())
    play(endless, PlaybackTiming(0, 10**9), tape.sinks(), Report())
    assert len(tape.messages) == 2


def test_messages_without_a_clock_come_in_order_and_end_with_the_pass():
    """The report counts the messages of all passes."""
    tape, report = Tape(), Report()
    for _ in range(2):
        play(numbered(3), PlaybackTiming(0, 20_000_000, 10.0, 0.0), tape.sinks(), report)
    assert [data[0] for _, data, _ in tape.messages] == [0, 1, 2, 0, 1, 2]
    assert (report.messages, len(report.lateness_ms)) == (6, 6)
    assert not tape.ticks


def test_progress_reaches_the_end_of_the_pass():
    seen = []
    sinks = Sinks(lambda topic, data: None, lambda time_ns: None, seen.append, lambda: False)
    play(iter([("/a", 1_010_000_000, b"")]), PlaybackTiming(10**9, 1_030_000_000), sinks, Report())
    assert seen[-1] == 1_030_000_000
    assert seen == sorted(seen)


def test_a_report_by_hand():
    """The p99 of 101 values 0 to 100 is the one with rank 99."""
    report = Report(101, 2.5, [float(k) for k in range(101)])
    assert report.percentiles() == (50.0, 99.0, 100.0)
    assert report.sentence() == (
        "101 messages in 2.50 s; lateness p50 50.00 ms, p99 99.00 ms, max 100.00 ms"
    )
    assert Report().percentiles() == (0.0, 0.0, 0.0)
