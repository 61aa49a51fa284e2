# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions read from a bag one after the other."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest

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
