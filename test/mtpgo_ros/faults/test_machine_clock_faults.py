# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The machine's clock is set while the node runs, the tracker's or both, over real DDS."""

import signal
import time

import numpy as np
import pytest
import rclpy
from fault_harness import ERROR, OK, RELIABLE
from fault_tools import HealthListener, ServiceManager, state_of
from machine_clock import MachineClock, compiled, tracker
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from ros_helpers import LIMIT_S, Process, end, message_of, traffic
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.outputs.quality_table import quality_from_array
from msg_adapters.registry import INPUTS

HOUR_S = 3600.0

SILENCE_S = 5.0
"""Longest time without a prediction (s): less than one is promised, a busy machine pauses."""

FORGOTTEN_S = 20.0
"""After this long without a sign of life Fast DDS forgets another participant (s)."""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """What sets the clock of the processes that load it."""
    return compiled(tmp_path_factory.mktemp("clock"))


@pytest.fixture(scope="module")
def clocks(library, tmp_path_factory):
    """The clocks of the node and of the tracker."""
    folder = tmp_path_factory.mktemp("clocks")
    return {name: MachineClock(library, folder / name) for name in ("node", "tracker")}


@pytest.fixture(scope="module")
def manager(tmp_path_factory):
    """A service manager that expects a sign of life every second."""
    return ServiceManager(tmp_path_factory.mktemp("service") / "notify")


def keep_scores(node):
    """Keep the scores that a node publishes from now on in ``misses``."""
    node.misses = []
    node.peer.create_subscription(
        Float64MultiArray,
        "predictor/quality_table",
        lambda table: node.misses.append(quality_from_array(table)["miss_rate"]),
        RELIABLE,
    )


@pytest.fixture(scope="module")
def node(start_predictor, clocks, manager):
    """A predictor with a clock of its own, as a service; its scores are kept in ``misses``."""
    with pytest.MonkeyPatch.context() as patch, clocks["node"].loaded():
        patch.setenv("NOTIFY_SOCKET", manager.path)
        patch.setenv("WATCHDOG_USEC", "1000000")
        node = start_predictor(
            quality_min_agents=1, quality_window=60, input_timeout=SILENCE_S, own_diagnostics=True
        )
    keep_scores(node)
    return node


@pytest.fixture(scope="module")
def _tracking(node, clocks):
    with tracker(node.namespace, clocks["tracker"]):
        node.until(lambda: len(node.answers) > 5, "predictions of the tracker")
        yield


@pytest.fixture
def together(node, clocks):
    """A function that sets the node's clock to the tracker's, and lets the node settle on it."""

    def together():
        clocks["node"].set_by(clocks["tracker"].offset_s - clocks["node"].offset_s)
        predicts(node, clocks["tracker"])
        node.level("input", OK)

    return together


@pytest.fixture(scope="module")
def looker(start_predictor):
    """Another predictor, whose clock is right; its scores are kept in ``misses``."""
    node = start_predictor(quality_min_agents=1, quality_window=60, own_diagnostics=True)
    keep_scores(node)
    return node


@pytest.fixture(scope="module")
def behind(looker, library, tmp_path_factory):
    """The clock of its tracker on another machine, two minutes behind."""
    clock = MachineClock(library, tmp_path_factory.mktemp("behind") / "clock")
    clock.set_by(-120.0)
    with tracker(looker.namespace, clock):
        predicts(looker, clock, 20)
        yield clock


def predicts(node, clock, number=6):
    """Wait for predictions whose stamps are of a clock; return the longest silence (s)."""
    first, begin_s = len(node.answers), time.monotonic()

    def of_that_clock():
        now_ns = time.time_ns() + round(clock.offset_s * 1e9)
        stamps = [answer.prediction.stamp_ns for answer in node.answers[first:]]
        return sum(abs(now_ns - stamp_ns) < SILENCE_S * 1e9 for stamp_ns in stamps)

    node.until(lambda: of_that_clock() >= number, f"{number} predictions of that clock")
    times_s = [begin_s, *(answer.received_s for answer in node.answers[first:])]
    return float(np.diff(times_s).max())


def most_missed(node):
    """Return the largest share of predictions that were off in any table so far."""
    return np.nanmax([np.nanmax(table, initial=0.0) for table in node.misses], initial=0.0)


def value(node, status, key):
    """Return a value of a status."""
    return next(pair.value for pair in node.statuses[status].values if pair.key == key)


# Before the tracker of the other tests starts.
@pytest.mark.parametrize("by_s", [-HOUR_S, HOUR_S])
def test_a_node_without_input_stays_alive(node, clocks, manager, by_s):
    """Where nothing comes, only its own timers wake the process."""
    node.fresh().healthy()
    node.level("input", ERROR, "stale")
    health = HealthListener(node)
    health.becomes(ERROR, "stale")
    clocks["node"].set_by(by_s)
    heard, told = len(health.heard), len(manager.messages)
    node.until(lambda: len(health.heard) > heard + 5, "verdicts")
    node.until(
        lambda: manager.hears("") and manager.messages[told:].count("WATCHDOG=1") > 2,
        "signs of life",
    )
    assert state_of(node) == "active"
    with tracker(node.namespace, clocks["node"]):
        predicts(node, clocks["node"])
        node.level("input", OK)
        health.becomes(OK)
    node.until(lambda: any("clock was set" in line for line in node.process.err), "a line")


@pytest.mark.parametrize(
    ("whose", "by_s"),
    [
        *(("both", by_s) for by_s in (-HOUR_S, HOUR_S, -2.0, 2.0, -0.3, 0.3)),
        *(("node", by_s) for by_s in (-HOUR_S, HOUR_S)),
        *(("tracker", by_s) for by_s in (-HOUR_S, HOUR_S, -2.0, 2.0)),
    ],
)
@pytest.mark.usefixtures("_tracking")
def test_predictions_go_on_and_are_judged_by_the_same_clock(node, clocks, together, whose, by_s):
    together()
    before, first_table = len(node.seen), len(node.misses)
    for name in clocks if whose == "both" else (whose,):
        clocks[name].set_by(by_s)
    assert predicts(node, clocks["tracker"]) < SILENCE_S
    said = [message for name, _, message in node.seen[before:] if name == "input"]
    assert not any("stale" in message for message in said), said
    # Nothing waited for an hour, whatever the clock says.
    assert float(value(node, "timing", "latency_ms_max")) < 60e3
    # A second later, what was predicted is compared with what happened: none is off by 2 m.
    node.until(lambda: len(node.misses) > first_table + 2, "scores")
    assert most_missed(node) == 0.0


@pytest.mark.parametrize("by_s", [1.0, 2.0, 50.0])
def test_a_tracker_whose_clock_is_behind_and_is_set_forward_is_noticed(looker, behind, by_s):
    first_table = len(looker.misses)
    with looker.counts(clock_set=1, clock_reset=0, future_stamp=0):
        behind.set_by(by_s)
        assert predicts(looker, behind, 20) < SILENCE_S
    looker.until(lambda: len(looker.misses) > first_table + 2, "scores")
    assert most_missed(looker) == 0.0


def test_messages_that_were_held_up_do_not_look_like_a_clock_that_was_set(looker, behind):
    with looker.counts(clock_set=0, clock_reset=0):
        looker.process.popen.send_signal(signal.SIGSTOP)
        try:
            time.sleep(3.0)
        finally:
            looker.process.popen.send_signal(signal.SIGCONT)
        predicts(looker, behind, 20)


@pytest.mark.usefixtures("_tracking")
def test_a_clock_whose_rate_is_adjusted_is_not_set(node, clocks, together):
    together()
    begin_s, begun = time.monotonic(), clocks["node"].offset_s
    with node.counts(clock_set=0, clock_reset=0, future_stamp=0):
        while time.monotonic() < begin_s + 2.0:
            node.spin()
            ahead_s = 5e-4 * (time.monotonic() - begin_s)
            for clock in clocks.values():
                clock.set_by(begun + ahead_s - clock.offset_s)
    assert predicts(node, clocks["tracker"]) < SILENCE_S


def test_a_node_without_subscribers_is_not_forgotten(library, tmp_path, models):
    clock, looker = MachineClock(library, tmp_path / "clock"), Node("looker")
    with clock.loaded():
        process = Process(
            "predictor",
            *("--ros-args", "-p", f"model:={models['quick']}"),
            *("-r", "__node:=unheard", "-r", "/diagnostics:=unheard"),
        )

    def is_known():
        return "unheard" in looker.get_node_names()

    try:
        process.wait_for("ready")
        end_s = time.monotonic() + LIMIT_S
        while not is_known():
            assert time.monotonic() < end_s
            time.sleep(0.1)
        clock.set_by(-HOUR_S)
        end_s = time.monotonic() + FORGOTTEN_S + 5.0
        while time.monotonic() < end_s:
            assert is_known()
            time.sleep(0.5)
        assert process.interrupt(signal.SIGTERM)[0] == 0
    finally:
        end(process.popen)
        looker.destroy_node()


@pytest.mark.parametrize("by_s", [-HOUR_S, HOUR_S])
def test_a_recording_keeps_order_and_distances(library, tmp_path, process, peer, by_s):
    clock, output = MachineClock(library, tmp_path / "clock"), tmp_path / "recording"
    with clock.loaded():
        recorder = process("record", "-o", output, "--topics", "/set_clock")
    # Latched: a message that is sent before discovery has ended there as well comes later.
    latched = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = peer.create_publisher(PointCloud2, "/set_clock", latched)
    recorder.wait_for("ready")
    end_s = time.monotonic() + LIMIT_S
    while not publisher.get_subscription_count():
        assert time.monotonic() < end_s
        time.sleep(0.02)
    begin_s = time.monotonic()
    sent = []
    for number in range(20):
        message = message_of(traffic(0.1 * number))
        sent.append(serialize_message(message)[4:12])  # its stamp
        publisher.publish(message)
        if number == 10:
            clock.set_by(by_s)
        time.sleep(0.05)
    assert publisher.wait_for_all_acked()
    assert recorder.interrupt(signal.SIGINT)[0] == 0
    passed_s = time.monotonic() - begin_s
    with AnyReader([output]) as bag:
        stored = [(time_ns, data) for _, time_ns, data in bag.messages()]
    times_s = np.array([time_ns for time_ns, _ in stored]) * 1e-9
    assert len(stored) == 20
    assert [bytes(data[4:12]) for _, data in stored] == sent
    assert times_s[-1] - times_s[0] < passed_s


@pytest.mark.parametrize("by_s", [-HOUR_S, HOUR_S])
def test_a_bag_is_played_to_its_end_at_its_pace(library, tmp_path, process, peer, by_s):
    clock, played = MachineClock(library, tmp_path / "clock"), tmp_path / "played"
    with McapWriter(played) as bag:
        bag.add_topic("/played", "sensor_msgs/msg/PointCloud2")
        for number in range(40):
            states = traffic(0.05 * number)
            message = INPUTS["pointcloud2"].from_states(states, bag.types)
            bag.write("/played", states.stamp_ns, message)
    heard = []
    peer.create_subscription(PointCloud2, "/played", heard.append, RELIABLE)
    with clock.loaded():
        player = process("replay", played, "--wait-for-subscribers", "1")
    end_s = time.monotonic() + LIMIT_S
    while len(heard) < 40:
        assert time.monotonic() < end_s
        rclpy.spin_once(peer, timeout_sec=0.05)
        if len(heard) == 10 and not clock.offset_s:
            clock.set_by(by_s)
    assert player.finish()[0] == 0
