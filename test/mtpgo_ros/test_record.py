# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The executable ``record``: its bags hold what was published, for several libraries."""

import resource
import signal
import time

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from ros_helpers import (
    LATCHED,
    LIMIT_S,
    message_of,
    one_line,
    run_process,
    traffic,
)
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.bags.stored_bag import StoredBag
from msg_adapters.registry import INPUTS
from mtpgo_ros.record import _parser, topics_of


def test_the_topics_follow_the_predictors_name():
    def topics(*arguments):
        return topics_of(_parser().parse_args(["-o", "x", *arguments]))

    assert topics() == [
        "/predictor/predictions",
        "/predictor/debug/processing_time_ms",
        "/predictor/quality",
        "/predictor/quality_table",
        "/diagnostics",
    ]
    assert topics("--predictor", "ego/predictor", "--objects")[0::5] == [
        "/ego/predictor/predictions",
        "/objects",
    ]
    assert topics("--objects", "/perception/objects")[-1] == "/perception/objects"
    assert topics("--topics", "a", "/b", "a") == ["/a", "/b"]


@pytest.mark.parametrize(
    ("name", "number"), [("recording", signal.SIGINT), ("recording.mcap", signal.SIGTERM)]
)
def test_a_recording_ended_by_a_signal_is_complete(process, peer, tmp_path, name, number):
    output = tmp_path / "new" / name
    recorder = process(
        *("record", "-o", output, "--topics", "/predictor/predictions", "/objects", "/ego_id"),
        *("/diagnostics", "/nothing"),
    )
    recorder.wait_for("ready: recording")
    # The first topic's type is known beforehand, the others' with their publishers.
    clouds = [
        peer.create_publisher(PointCloud2, topic, QoSProfile(depth=50))
        for topic in ("/predictor/predictions", "/objects")
    ]
    ego = peer.create_publisher(String, "/ego_id", LATCHED)
    ego.publish(String(data="3"))
    end = time.monotonic() + LIMIT_S
    while any(p.get_subscription_count() == 0 for p in (*clouds, ego)):
        assert time.monotonic() < end
        time.sleep(0.02)
    sent = [message_of(traffic(step / 25)) for step in range(50)]
    for message in sent:
        for publisher in clouds:
            publisher.publish(message)
    for publisher in (*clouds, ego):
        assert publisher.wait_for_all_acked(Duration(seconds=LIMIT_S))
    status, out, err = recorder.interrupt(number)
    assert (status, "Traceback" in err) == (0, False), err
    assert "recorded 101 messages" in out
    assert "no publisher on /diagnostics, /nothing" in out
    assert [file.name for file in output.parent.iterdir()] == [name]  # nothing temporary is left

    with AnyReader([output]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        assert counts == {
            "/predictor/predictions": 50,
            "/objects": 50,
            "/ego_id": 1,
        }
        decoded = [
            reader.deserialize(data, c.msgtype)
            for c, _, data in reader.messages()
            if c.topic == "/objects"
        ]
        assert abs(reader.start_time - time.time_ns()) < 3600 * 10**9  # the wall clock
    adapter = INPUTS["pointcloud2"]
    for given, kept in zip(sent, decoded, strict=True):
        one, other = adapter.to_states(given), adapter.to_states(kept)
        assert one.stamp_ns == other.stamp_ns
        assert np.array_equal(one.position, other.position)
    single = output if output.is_file() else output / f"{name}.mcap"
    with single.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        egos = [found[-1].data for found in reader.iter_decoded_messages(topics=["/ego_id"])]
    assert egos == ["3"]
    if output.is_dir():
        about = yaml.safe_load((output / "metadata.yaml").read_text())
        about = about["rosbag2_bagfile_information"]
        assert (about["storage_identifier"], about["message_count"]) == ("mcap", 101)
        profiles = {
            topic["topic_metadata"]["name"]: topic["topic_metadata"]["offered_qos_profiles"]
            for topic in about["topics_with_message_count"]
        }
        assert profiles["/ego_id"][0]["durability"] == "transient_local"


def test_a_recording_of_nothing_ends_with_its_own_status(tmp_path):
    status, out, err = run_process("record", "-o", tmp_path / "bag", "--duration", "0.2")
    assert status == 1
    assert out.count("\n") == 1  # ready
    assert one_line(err).startswith("record: recorded no message into")
    assert "no publisher on /predictor/predictions" in err
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 0


def _publishing(peer, recorder, path):
    """Publish texts of 1 kB until messages were written; return a function that goes on.

    At 50 Hz a recorder that is paused for 3 s, whose queue holds 200, loses none.
    """
    publisher = peer.create_publisher(String, "/x", QoSProfile(depth=1000))
    sent = []

    def publish():
        publisher.publish(String(data=f"{len(sent):08d}" + 1000 * "x"))
        sent.append(len(sent))
        time.sleep(0.02)

    recorder.wait_for("ready: recording")
    end = time.monotonic() + LIMIT_S
    while not path.exists() or not _numbers(path):
        assert time.monotonic() < end
        publish()
    return publish


def _numbers(path):
    with StoredBag(path) as bag:
        return [int(data[8:16]) for _, _, data in bag.messages()]


def _are_what_was_sent(numbers):
    # The first ones may have come before the subscription.
    return numbers == list(range(numbers[0], numbers[-1] + 1))


def test_a_killed_recording_keeps_what_it_has_written(process, peer, tmp_path):
    path = tmp_path / "bag"
    recorder = process("record", "-o", path, "--topics", "/x")
    publish = _publishing(peer, recorder, path)
    written = len(_numbers(path))
    for _ in range(20):
        publish()
    status, _, _ = recorder.interrupt(signal.SIGKILL)
    assert status == -signal.SIGKILL
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]
    numbers = _numbers(path)
    assert len(numbers) >= written
    assert _are_what_was_sent(numbers)
    with StoredBag(path) as bag:
        (loss,) = bag.losses()
        assert (loss.messages, loss.read) == (0, len(numbers))


def test_a_full_disk_ends_a_recording_and_keeps_it(process, peer, tmp_path):
    path = tmp_path / "bag"
    recorder = process("record", "-o", path, "--topics", "/x")
    publish = _publishing(peer, recorder, path)
    written = len(_numbers(path))
    room = (path / "bag.mcap").stat().st_size + 1500
    resource.prlimit(recorder.popen.pid, resource.RLIMIT_FSIZE, (room, room))
    end = time.monotonic() + LIMIT_S
    while recorder.popen.poll() is None:
        assert time.monotonic() < end
        publish()
    status, out, err = recorder.finish()
    assert (status, out.count("\n")) == (2, 1)
    sentence = one_line(err)
    assert sentence.startswith(f"record: output {path} cannot be written: File too large")
    numbers = _numbers(path)
    assert len(numbers) >= written
    assert f"the {len(numbers)} messages (" in sentence
    assert _are_what_was_sent(numbers)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "EXISTING"], "exists already"),
        (["-o", "/proc/nowhere/bag"], "/proc/nowhere/bag cannot be written"),
        (["-o", "NEW", "--topics", "/a b"], "'/a b'"),
        ([], "-o"),
    ],
)
def test_the_executable_answers_bad_input_with_one_sentence(tmp_path, arguments, words):
    places = {"EXISTING": str(tmp_path), "NEW": str(tmp_path / "new")}
    given = [places.get(word, word) for word in arguments]
    status, out, err = run_process("record", *given)
    assert (status, out) == (2, "")
    assert words in one_line(err)
    assert not list(tmp_path.iterdir())
