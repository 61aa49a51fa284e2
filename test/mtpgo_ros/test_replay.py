# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``replay``: its timing without ROS, and the executable over DDS."""

import itertools
import time

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from ros_helpers import LATCHED, LIMIT_S, START_NS, one_line, run_process, traffic
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.conversions import stamp_to_ns
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError
from mtpgo_ros.bags.playback import PlaybackTiming, Report, Sinks, play


def write_bag(path, *, seconds=1.0, kind="pointcloud2"):
    """25 Hz of four cars on /objects, and a latched ego."""
    adapter = INPUTS[kind]
    with McapWriter(path) as bag:
        bag.add_topic("/ego_id", "std_msgs/msg/String", latched=True)
        bag.add_topic("/objects", adapter.message_type)
        bag.write("/ego_id", START_NS, bag.types.make("std_msgs/msg/String", data="3"))
        for step in range(round(25 * seconds) + 1):
            states = traffic(step / 25)
            bag.write("/objects", states.stamp_ns, adapter.from_states(states, bag.types))
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("bag") / "traffic")


class Tape:
    """Sinks that write down what came when."""

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
def test_messages_and_ticks_have_their_own_moments(rate):
    tape, report = Tape(), Report()
    play(numbered(41), PlaybackTiming(0, 400_000_000, rate, 100.0), tape.sinks(), report)
    assert [data[0] for _, data, _ in tape.messages] == list(range(41))
    assert report.messages == 41
    assert report.wall_s >= 0.4 / rate
    # Never early; how late depends on the machine and is reported, here bounded loosely.
    wall = np.array([when for _, _, when in tape.messages])
    late = wall - np.arange(41) * 0.01 / rate
    assert (late >= 0.0).all()
    assert np.median(report.lateness_ms) < 20.0
    assert report.percentiles()[2] == max(report.lateness_ms)
    # The clock counts the recording's time, 100 ticks a second of the wall, and starts at once.
    stamps = [time_ns for time_ns, _ in tape.ticks]
    assert stamps[0] == 0
    assert np.diff(stamps).min() > 0
    assert all(s % round(rate * 10_000_000) == 0 for s in stamps)
    assert all(when >= s * 1e-9 / rate for s, when in tape.ticks)


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


class Listener:
    """A node that hears what a player says."""

    def __init__(self, peer):
        self.objects, self.ticks, self.egos = [], [], []
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(peer)
        peer.create_subscription(PointCloud2, "/objects", self._on_objects, 100)
        peer.create_subscription(Clock, "/clock", self._on_clock, 1000)
        peer.create_subscription(String, "/ego_id", lambda m: self.egos.append(m.data), LATCHED)

    def _on_objects(self, message):
        self.objects.append(stamp_to_ns(message.header.stamp) - START_NS)

    def _on_clock(self, message):
        self.ticks.append(stamp_to_ns(message.clock) - START_NS)

    def spin_until(self, condition):
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end
            self.spin()

    def spin(self):
        self.executor.spin_once(timeout_sec=0.02)


def test_the_executable_plays_every_message_with_the_clock(process, peer, bag):
    listener = Listener(peer)
    player = process("replay", bag, "--wait-for-subscribers", "1")
    listener.spin_until(lambda: player.popen.poll() is not None)
    status, out, err = player.finish()
    listener.spin_until(lambda: len(listener.objects) == 26)
    assert status == 0, err
    assert listener.objects == [40_000_000 * k for k in range(26)]
    assert listener.egos == ["3"]
    assert listener.ticks[0] == 0
    assert len(listener.ticks) > 50
    assert np.diff(listener.ticks).min() > 0
    assert "played 27 messages" in one_line(out)
    assert "lateness p50" in out
    assert "replay:" in err  # the progress bar
    assert "Traceback" not in err


def test_a_part_of_a_bag_is_looped_faster_until_interrupted(process, peer, bag):
    listener = Listener(peer)
    player = process(
        *("replay", bag, "--loop", "--rate", "4", "--start-offset", "0.5", "--duration", "0.2"),
        *("--wait-for-subscribers", "1", "--no-progress", "--clock-rate", "0"),
    )
    # From 0.52 s to 0.68 s, again and again; what was latched before the offset is there.
    once = [520_000_000, 560_000_000, 600_000_000, 640_000_000, 680_000_000]
    listener.spin_until(lambda: len(listener.objects) >= 15)
    assert listener.objects[:15] == once * 3
    listener.spin_until(lambda: listener.egos == ["3"])
    assert not listener.ticks
    status, out, err = player.interrupt()
    assert (status, err) == (0, "")
    assert "played" in out


def test_a_paused_start_waits_for_a_line(process, peer, bag):
    listener = Listener(peer)
    player = process("replay", bag, "--start-paused", "--wait-for-subscribers", "1", "--rate", "5")
    player.wait_for("paused", listener.spin)
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        listener.spin()
    assert (listener.objects, listener.ticks) == ([], [])
    player.popen.stdin.write("\n")
    player.popen.stdin.flush()
    listener.spin_until(lambda: len(listener.objects) == 26)
    status, _, err = player.finish()
    assert status == 0, err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["/no/such/bag"], "/no/such/bag does not exist"),
        (["BAG", "--topics", "/lidar"], "no messages on topic /lidar"),
        (["BAG", "--rate", "-1"], "--rate"),
        (["BAG", "--start-offset", "99"], "--start-offset"),
        (["BAG", "--wait-for-subscribers", "1", "--wait-timeout", "0.1"], "0 subscribers"),
    ],
)
def test_the_executable_answers_bad_input_with_one_sentence(bag, arguments, words):
    given = [str(bag) if word == "BAG" else word for word in arguments]
    status, out, err = run_process("replay", *given)
    assert (status, out) == (2, "")
    assert words in one_line(err)


def test_types_that_are_not_installed_are_skipped_with_a_sentence(tmp_path):
    path = write_bag(tmp_path / "bag", seconds=0.1, kind="autoware")
    status, _, err = run_process("replay", path, "--no-progress", "--delay", "0")
    assert status == 0
    assert "ros-jazzy-autoware-perception-msgs" in one_line(err)
    status, _, err = run_process("replay", path, "--topics", "/objects")
    assert status == 2
    assert "no topic that can be played" in err.splitlines()[-1]


def test_the_read_ahead_thread_ends_with_the_pass():
    tape = Tape(limit=2)
    endless = (("/a", k, b"") for k in itertools.count())
    play(endless, PlaybackTiming(0, 10**9), tape.sinks(), Report())
    assert len(tape.messages) == 2
