# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The player's publishers, its clock and what it waits for, in this process."""

import dataclasses
import time

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy
from ros_helpers import LATCHED, LIMIT_S
from std_msgs.msg import String

from msg_adapters.bags.bag_reader import BagReader
from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_core.errors import RecordingError
from mtpgo_ros.bags.playback import PlaybackTiming
from mtpgo_ros.bags.player_node import BagPlayer, Wait

STEP_NS = 10_000_000


@pytest.fixture
def bag(tmp_path):
    """An open bag: five texts on /player_text, a latched one before them, and a clock."""
    with McapWriter(tmp_path / "bag.mcap") as writer:
        writer.add_topic("/player_ego", "std_msgs/msg/String", latched=True)
        writer.add_topic("/player_text", "std_msgs/msg/String")
        writer.add_topic("/clock", "rosgraph_msgs/msg/Clock")
        make = writer.types.make
        writer.write("/player_ego", 0, make("std_msgs/msg/String", data="ego"))
        writer.write("/clock", 0, make("rosgraph_msgs/msg/Clock"))
        for step in range(5):
            text = make("std_msgs/msg/String", data=str(step))
            writer.write("/player_text", step * STEP_NS, text)
    with BagReader(tmp_path / "bag.mcap") as reader:
        yield reader


@pytest.fixture
def player(bag):
    """Return a function that makes a player of the bag; all are closed at the end."""
    made = []

    def make(origin_ns=0, clock_hz=0.0):
        timing = PlaybackTiming(origin_ns, bag.end_ns, clock_hz=clock_hz)
        made.append(BagPlayer(bag, timing, bag.topics()))
        return made[-1]

    yield make
    for one in made:
        one.close()


def until(condition, meanwhile=lambda: time.sleep(0.02)):
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end, "the condition did not come true in time"
        meanwhile()


def test_a_recorded_clock_is_left_out_where_the_player_has_its_own(player):
    assert set(player(clock_hz=100.0)._publishers) == {"/player_ego", "/player_text"}
    assert set(player(clock_hz=0.0)._publishers) == {"/player_ego", "/player_text", "/clock"}


@pytest.mark.parametrize("start_s", [2**31 - 1, 2**32 + 5])
def test_times_that_the_clock_cannot_show_are_refused(tmp_path, start_s):
    with McapWriter(tmp_path / "bag.mcap") as writer:
        writer.add_topic("/player_text", "std_msgs/msg/String")
        text = writer.types.make("std_msgs/msg/String", data="text")
        for step in range(3):
            writer.write("/player_text", start_s * 10**9 + step * 10**9, text)
    with BagReader(tmp_path / "bag.mcap") as bag:
        timing = PlaybackTiming(bag.start_ns, bag.end_ns)
        with pytest.raises(RecordingError, match=f"from {start_s} s .* --clock-rate 0"):
            BagPlayer(bag, timing, bag.topics())
        without = dataclasses.replace(timing, clock_hz=0.0)
        BagPlayer(bag, without, bag.topics()).close()


def test_topics_that_ros_does_not_accept_are_skipped_with_a_sentence(tmp_path, capsys):
    with McapWriter(tmp_path / "names.mcap") as writer:
        for topic in ("/of-another-writer", "/rosout", "/player_text"):
            writer.add_topic(topic, "std_msgs/msg/String")
            writer.write(topic, 0, writer.types.make("std_msgs/msg/String", data="text"))
    with BagReader(tmp_path / "names.mcap") as reader:
        player = BagPlayer(reader, PlaybackTiming(0, reader.end_ns), reader.topics())
        assert set(player._publishers) == {"/player_text"}
        player.close()
    name, type_ = sorted(capsys.readouterr().err.splitlines())
    assert "skipping /of-another-writer: not accepted by ROS: Invalid topic name" in name
    assert "skipping /rosout: not accepted by ROS" in type_
    assert "rt/rosout with incompatible type" in type_


def test_latched_topics_stay_latched(player):
    profiles = {name: p.qos_profile for name, p in player()._publishers.items()}
    assert profiles["/player_ego"].durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert profiles["/player_ego"].depth == 1  # as many as the bag has
    assert profiles["/player_text"].durability is DurabilityPolicy.VOLATILE


def test_a_late_start_publishes_what_was_latched_before(player, peer):
    """From the third text on, and the latched message that came before it."""
    texts, egos = [], []
    subscriptions = [
        peer.create_subscription(String, "/player_text", lambda m: texts.append(m.data), 10),
        peer.create_subscription(String, "/player_ego", lambda m: egos.append(m.data), LATCHED),
    ]
    executor = SingleThreadedExecutor()
    executor.add_node(peer)
    one = player(origin_ns=2 * STEP_NS)
    assert one.wait(Wait(1, LIMIT_S, 0.0), lambda: False)
    publishers = [one._publishers[name] for name in ("/player_text", "/player_ego")]
    until(lambda: all(p.get_subscription_count() > 0 for p in publishers))
    until(lambda: all(s.get_publisher_count() > 0 for s in subscriptions))
    report = one.run(lambda: False, loop=False, progress=False)
    until(lambda: len(texts) == 3 and egos, lambda: executor.spin_once(timeout_sec=0.02))
    executor.shutdown()
    assert (texts, egos) == (["2", "3", "4"], ["ego"])
    assert report.messages == 3  # the latched message is not part of the pass


def test_too_few_subscribers_are_counted_and_the_topics_named(player):
    with pytest.raises(RecordingError) as error:
        player().wait(Wait(3, 0.05, 0.0), lambda: False)
    sentence = "0 subscribers after 0.05 s on the topics"
    assert str(error.value).startswith(sentence)
    assert str(error.value).endswith("expected 3")
    assert "/player_text" in str(error.value)


def test_a_node_with_two_subscriptions_is_one_subscriber(player, peer):
    """As the predictor while it subscribes anew; the recorder would be waited for no longer."""
    one = player()
    for _ in range(2):
        peer.create_subscription(String, "/player_text", lambda _: None, 10)
    publisher = one._publishers["/player_text"]
    until(lambda: publisher.get_subscription_count() == 2)
    with pytest.raises(RecordingError, match=r"^1 subscribers after 0\.3 s"):
        one.wait(Wait(2, 0.3, 0.0), lambda: False)
    other = rclpy.create_node("player_peer_2")
    try:
        other.create_subscription(String, "/player_text", lambda _: None, 10)
        assert one.wait(Wait(2, LIMIT_S, 0.0), lambda: False)
    finally:
        other.destroy_node()


def test_a_stop_ends_the_waiting(player):
    assert not player().wait(Wait(3, 60.0, 60.0, paused=True), lambda: True)
    assert player().wait(Wait(0, 60.0, 0.0), lambda: False)


def test_a_bag_without_a_topic_that_can_be_played_is_refused(bag):
    timing = PlaybackTiming(0, bag.end_ns, clock_hz=100.0)
    with pytest.raises(RecordingError, match="no topic that can be played here, its types: none"):
        BagPlayer(bag, timing, bag.topics(["/clock"]))


class NeverArrived:
    """A publisher with a subscriber that is stopped: waiting for it takes as long as allowed."""

    def __init__(self, waits):
        self.waits = waits

    def publish(self, data):
        pass

    def wait_for_all_acked(self, timeout):
        self.waits.append(timeout.nanoseconds)
        time.sleep(timeout.nanoseconds * 1e-9)


@pytest.mark.parametrize("signal_comes", [False, True])
def test_stopped_subscribers_hold_up_the_end_once_and_a_signal_not_at_all(
    player, monkeypatch, signal_comes
):
    monkeypatch.setattr("mtpgo_ros.bags.player_node._ARRIVAL_S", 0.05)
    one, waits = player(), []
    monkeypatch.setattr(one, "_publishers", {n: NeverArrived(waits) for n in one._publishers})
    one.run(lambda: signal_comes, loop=False, progress=False)
    assert len(waits) == (0 if signal_comes else 1)
    assert sum(waits) <= 50_000_000
