# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions read from a bag one after the other."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.writer import Writer

from msg_adapters.bags import stored_bag
from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.predictions import prediction_to_pointcloud2, predictions_in_bag
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError

TYPE = "sensor_msgs/msg/PointCloud2"


@pytest.fixture
def bag(tmp_path, prediction, states):
    """Objects and three predictions in one bag, the last two with the same stamp."""
    path = tmp_path / "drive.mcap"
    with McapWriter(path) as out:
        for topic in ("/objects", "/predictor/predictions"):
            out.add_topic(topic, TYPE)
        objects = INPUTS["pointcloud2"].from_states(states, out.types)
        for number in range(3):
            stamp_ns = prediction.stamp_ns + min(number, 1) * 200_000_000
            one = dataclasses.replace(prediction, stamp_ns=stamp_ns)
            out.write("/objects", stamp_ns, objects)
            log_ns = prediction.stamp_ns + number * 10**9
            out.write("/predictor/predictions", log_ns, prediction_to_pointcloud2(one, out.types))
    return path


def test_all_predictions_come_in_the_order_of_the_recording(bag, prediction):
    for topic in (None, "/predictor/predictions", "predictor/predictions"):
        stamps = [one.stamp_ns - prediction.stamp_ns for one in predictions_in_bag(bag, topic)]
        assert stamps == [0, 200_000_000, 200_000_000]
    assert len(next(predictions_in_bag(str(bag)))) == 3


def test_messages_that_cannot_be_read_are_left_out_and_counted(
    bag, prediction, tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(stored_bag, "_told", set())
    path = tmp_path / "odd.mcap"
    with path.open("wb") as stream, DecodingBagReader(bag) as reader:
        writer = Writer(stream)
        writer.start(profile="ros2")
        text = reader.connections[0].msgdef.data.encode()
        schema = writer.register_schema(TYPE, "ros2msg", text)
        # A bridge to the web writes clouds as JSON.
        web = writer.register_channel("/web", "json", writer.register_schema(TYPE, "", b""))
        writer.add_message(web, 0, b"{}", 0)
        channel = writer.register_channel("/predictor/predictions", "cdr", schema)
        stored = [c for c in reader.connections if c.topic == "/predictor/predictions"]
        for number, (_, time_ns, data) in enumerate(reader.stored(stored)):
            data = bytes(data)
            # In the second one a field has another name.
            data = data.replace(b"weight", b"height") if number == 1 else data
            writer.add_message(channel, time_ns, data, time_ns)
        writer.finish()
    stamps = [one.stamp_ns - prediction.stamp_ns for one in predictions_in_bag(path)]
    assert stamps == [0, 200_000_000]
    assert "1 message of the predictions left out" in caplog.text
    assert "topic /predictor/predictions: " in caplog.text
    with pytest.raises(RecordingError, match="on the topic /web"):
        next(predictions_in_bag(path, "/web"))


def test_another_topic_or_file_is_refused_in_one_sentence(bag, tmp_path):
    with pytest.raises(RecordingError, match=r"topic /objects: .*holds no predictions"):
        next(predictions_in_bag(bag, "/objects"))
    with pytest.raises(RecordingError, match=r"has no predictions, it has .* on the topic /none"):
        next(predictions_in_bag(bag, "/none"))
    with pytest.raises(RecordingError, match="does not exist"):
        next(predictions_in_bag(tmp_path / "nothing.mcap"))


def test_the_decoder_needs_neither_torch_nor_what_is_optional():
    code = (
        "import sys, msg_adapters.predictions\n"
        "print(sorted({'torch', 'rosbags', 'pandas', 'rclpy'} & set(sys.modules)))"
    )
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, cwd=root, capture_output=True, check=True).stdout == b"[]\n"
