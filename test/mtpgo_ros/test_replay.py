# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The executable ``replay``, over DDS."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from ros_helpers import LATCHED, LIMIT_S, START_NS, LongStep, one_line, run_process, traffic
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.conversions import stamp_to_ns
from msg_adapters.inputs.lane_markers import lanes_from_markers
from msg_adapters.registry import INPUTS
from mtpgo_ros.replay import main


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


ATTEMPTS = 3
"""A part of what is played in real time is lost where a process is paused; what is never played is
lost each time."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("bag") / "traffic")


class Listener:
    """A node that stores what a player publishes."""

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
        assert self.comes_true(condition, LIMIT_S)

    def comes_true(self, condition, limit_s):
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                return False
            self.spin()
        return True

    def spin(self):
        self.executor.spin_once(timeout_sec=0.02)


def test_the_executable_plays_every_message_with_the_clock(process, peer, bag, tmp_path):
    listener = Listener(peer)
    lines, path = [], tmp_path / "lanes.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[0, 2], [900, 2]]}')
    peer.create_subscription(
        MarkerArray, "/lane_markings", lambda m: lines.append(lanes_from_markers(m)), LATCHED
    )
    for _ in range(ATTEMPTS):
        for heard in (listener.objects, listener.ticks, listener.egos, lines):
            heard.clear()
        player = process("replay", bag, "--wait-for-subscribers", "1", "--lane-file", path)
        listener.spin_until(lambda player=player: player.popen.poll() is not None)
        status, out, err = player.finish()
        assert status == 0, err
        whole = listener.comes_true(
            lambda: len(listener.objects) == 26 and listener.egos and lines, 5.0
        )
        if whole and len(listener.ticks) > 50:
            break
    assert listener.objects == [40_000_000 * k for k in range(26)]
    assert listener.egos == ["3"]
    (markings,) = lines
    assert markings.frame_id == "map"
    assert markings.polylines[0].tolist() == [[0.0, 2.0], [900.0, 2.0]]
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
    # From 0.52 s to 0.68 s in each pass; a latched message before the offset is published, too.
    once = [520_000_000, 560_000_000, 600_000_000, 640_000_000, 680_000_000]

    def passes():
        """Return whether three passes came whole, one after the other."""
        heard = listener.objects
        return any(heard[i : i + 15] == 3 * once for i in range(len(heard) - 14))

    listener.spin_until(passes)
    assert set(listener.objects) == set(once)
    listener.spin_until(lambda: listener.egos == ["3"])
    assert not listener.ticks
    status, out, err = player.interrupt()
    assert (status, err) == (0, "")
    assert "played" in out


def test_a_single_message_is_repeated_with_a_pause(process, peer, tmp_path):
    path = write_bag(tmp_path / "one", seconds=0.0)
    listener, began = Listener(peer), time.monotonic()
    player = process("replay", path, "--loop", "--wait-for-subscribers", "1", "--no-progress")
    listener.spin_until(lambda: len(listener.objects) >= 3)
    # One of them may have come twice or not at all; without a pause there are thousands.
    passed_s = time.monotonic() - began
    assert len(listener.objects) <= 1 + passed_s
    assert passed_s > 1.9
    status, _, err = player.interrupt()
    assert status == 0, err
    assert "all messages are of one time: they are repeated every 1 s" in one_line(err)


@pytest.mark.parametrize("words", ["--help", "--version"])
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    ("ending", "status", "sentence"),
    [
        ("> /dev/full", 2, "replay: No space left on device\n"),
        ("| true", 141, ""),
        (">&-", 0, ""),
    ],
)
def test_an_answer_that_cannot_be_written(words, unbuffered, ending, status, sentence):
    # The reader ends first.
    begin = "sleep 0.5; " if ending == "| true" else ""
    line = f"set -o pipefail; ({begin}exec {sys.executable} -m mtpgo_ros.replay {words}) {ending}"
    done = subprocess.run(
        ["bash", "-c", line],
        capture_output=True,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (status, sentence)


@pytest.mark.parametrize(
    "step",
    ["msg_adapters.bags.bag_reader.BagReader", "mtpgo_ros.bags.clock_gap.played_part"],
)
def test_a_signal_while_the_bag_is_opened(signals, monkeypatch, bag, step):
    long = LongStep(signal.SIGINT)
    monkeypatch.setattr(step, long)
    monkeypatch.setattr("mtpgo_ros.runtime.ros_start.start", lambda arguments: None)
    monkeypatch.setattr("rclpy.try_shutdown", lambda: None)  # the tests go on with it
    assert main([str(bag)]) == 0
    assert not long.ended


@pytest.fixture
def here(monkeypatch, peer):
    """Let the executable run in this process, of which rclpy goes on."""
    monkeypatch.setattr("mtpgo_ros.runtime.ros_start.start", lambda arguments: None)
    monkeypatch.setattr("rclpy.try_shutdown", lambda: None)


def test_times_of_any_size_are_answered(signals, here, bag, capsys):
    ends = ("--rate", "1000", "--delay", "0", "--no-progress")
    assert main([str(bag), "--duration", "1e300", *ends]) == 0
    assert "played 27 messages" in capsys.readouterr().out
    assert main([str(bag), "--start-offset", "1e300", *ends]) == 2
    assert "--start-offset is 1e+300 s, but bag" in one_line(capsys.readouterr().err)


def test_a_paused_start_without_standard_input_is_refused(signals, here, bag, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)  # as Python has it where the file is closed
    assert main([str(bag), "--start-paused", "--delay", "0", "--no-progress"]) == 2
    assert "waits for Enter on standard input, which is closed" in one_line(
        capsys.readouterr().err
    )


@pytest.mark.parametrize("ending", ["| true", ">&-", "2>&-"])
def test_the_bag_is_played_where_its_output_is_closed_or_not_read(bag, ending):
    """A reader that has ended, closed standard output, closed standard error."""
    played = f"{sys.executable} -m mtpgo_ros.replay {bag} --rate 1000 --delay 0 {ending}"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {played}"],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr


def test_a_paused_start_waits_for_a_line(process, peer, bag):
    listener = Listener(peer)
    player = process("replay", bag, "--start-paused", "--wait-for-subscribers", "1", "--loop")
    player.wait_for("paused", listener.spin)
    assert not listener.comes_true(lambda: listener.objects or listener.ticks, 0.3)
    player.popen.stdin.write("\n")
    player.popen.stdin.flush()
    listener.spin_until(lambda: listener.objects and listener.ticks)
    status, _, err = player.interrupt()
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


def test_a_cut_bag_is_played_as_far_as_it_goes_and_from_when_the_clock_was_set(tmp_path):
    path = tmp_path / "bag.mcap"
    with McapWriter(path) as bag:
        bag.add_topic("/objects", INPUTS["pointcloud2"].message_type)
        for time_ns in (0, *(traffic(step / 25).stamp_ns for step in range(26))):
            message = INPUTS["pointcloud2"].from_states(traffic(0.0), bag.types)
            bag.write("/objects", time_ns, message)
    path.write_bytes(path.read_bytes()[:10_000])
    status, out, err = run_process("replay", path, "--no-progress", "--delay", "0")
    assert status == 0
    assert "1 message before a gap of 53.9 years left out" in err
    played = int(out.split()[1])
    assert 5 < played < 26
    assert f"{path} is cut off, as when power is lost: {played + 1} messages" in err
    assert f"about {26 - played} messages ({(26 - played) / 25:.1f} s) lost" in err
