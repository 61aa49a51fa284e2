# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which topic of a bag is read as the tracked objects."""

import numpy as np
import pytest
from traffic import braking_cars

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.bags.bag_topics import objects_topic

STATES = next(braking_cars(tracks=2, seconds=1.0).states())


@pytest.fixture
def chosen(tmp_path):
    """Write a bag with one message on each topic (name: kind) and choose."""

    def chosen(**topics):
        with McapWriter(tmp_path / "bag.mcap", replace=True) as bag:
            for name, kind in topics.items():
                topic = "/" + name.replace("__", "/")
                if kind == "lanes":
                    bag.add_topic(topic, INPUTS["markers"].message_type)
                    line = np.array([[0.0, 0.0], [9.0, 0.0]])
                    message = lanes_to_markers((line,), bag.types, stamp_ns=1, frame_id="map")
                    bag.write(topic, STATES.stamp_ns, message)
                elif kind == "text":
                    bag.add_topic(topic, "std_msgs/msg/String")
                    message = bag.types.make("std_msgs/msg/String", data="hello")
                    bag.write(topic, STATES.stamp_ns, message)
                else:
                    adapter = INPUTS[kind.removeprefix("no ")]
                    bag.add_topic(topic, adapter.message_type)
                    if not kind.startswith("no "):
                        message = adapter.from_states(STATES, bag.types)
                        bag.write(topic, STATES.stamp_ns, message)
        with DecodingBagReader(tmp_path / "bag.mcap") as reader:
            topic = objects_topic(reader)
            assert {topic.adapter.message_type} == {c.msgtype for c in topic.connections}
            assert {topic.name} == {c.topic for c in topic.connections}
            return topic.name

    return chosen


def test_the_name_objects_comes_first(chosen):
    assert chosen(a="autoware", robot__objects="pointcloud2") == "/robot/objects"


def test_a_type_for_tracked_objects_comes_before_clouds_and_markers(chosen):
    assert chosen(a="pointcloud2", b="markers", z="autoware") == "/z"


def test_of_equal_topics_the_first_by_name_is_used(chosen):
    assert chosen(b="autoware", a="vision") == "/a"


def test_the_output_of_a_predictor_comes_last(chosen):
    assert chosen(a__predictions="pointcloud2", tracks="pointcloud2") == "/tracks"
    assert chosen(a__markers="markers", tracks="pointcloud2") == "/tracks"


def test_of_clouds_the_first_that_can_be_read_as_objects_is_used(chosen):
    assert chosen(a="lanes", b="pointcloud2") == "/b"


def test_lane_markings_and_topics_without_a_message_are_left_out(chosen):
    assert chosen(objects="no pointcloud2", lane_markings="lanes", z="markers") == "/z"


def test_no_usable_topic_is_reported_with_those_there_are(chosen):
    sentence = (
        r"bag\.mcap has no topic with tracked objects, it has /chatter \(std_msgs/msg/String\); "
        r"expected one of sensor_msgs/msg/PointCloud2, "
    )
    with pytest.raises(RecordingError, match=sentence):
        chosen(chatter="text")
