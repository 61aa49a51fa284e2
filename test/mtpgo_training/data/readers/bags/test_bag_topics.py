# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which topic of a bag is read as the tracked objects."""

import numpy as np
import pytest
from odd_bags import OddBag, bytes_of, states_at
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore
from traffic import braking_cars

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.inputs.ego_odometry import EgoOptions
from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.bags.bag_topics import (
    nearest_first,
    objects_topic,
    shared_namespaces,
)
from mtpgo_training.data.readers.reading_options import ReadingOptions

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


def read(path, **options):
    reading = ReadingOptions(bags=BagOptions(**options))
    return load_recordings(path, "bag", None, reading)


@pytest.fixture
def carla(tmp_path):
    """All road users on one topic, those in sight of a vehicle on another."""
    with OddBag(tmp_path / "town.mcap") as bag:
        sight = bag.objects("/carla/ego_vehicle/objects", kind="derived")
        everything = bag.objects("/carla/objects", kind="derived")
        for i in range(10):
            bag.add(sight, bytes_of(states_at(i / 10, ids=(1,)), "derived"), i / 10)
            bag.add(everything, bytes_of(states_at(i / 10), "derived"), i / 10)
    return tmp_path / "town.mcap"


def test_of_several_topics_the_choice_is_named(carla, caplog):
    (recording,) = read(carla)
    assert len(recording.track_id) == 3
    assert "read from /carla/objects, and not from /carla/ego_vehicle/objects" in caplog.text


def test_a_topic_can_be_chosen_for_all_bags_or_for_one(carla, caplog):
    for options in (
        {"topic": "/carla/ego_vehicle/objects"},
        {"topic": "carla/ego_vehicle/objects"},
        {"topic": "/carla/objects", "topics": {"town": "/carla/ego_vehicle/objects"}},
    ):
        (recording,) = read(carla, **options)
        assert len(recording.track_id) == 1
    assert not caplog.records


def test_a_choice_that_cannot_be_is_refused_with_what_there_is(carla, tmp_path):
    with pytest.raises(RecordingError, match=r"has no topic /x, it has /carla/ego_vehicle/obj"):
        read(carla, topic="/x")
    with pytest.raises(RecordingError, match=r"has no bag city, for which --topics names a topic"):
        read(carla, topics={"city": "/x"})
    with OddBag(tmp_path / "odd.mcap") as bag:
        for topic, encoding in (("/json", "json"), ("/talk", "cdr")):
            bag.add(bag.channel(topic, "std_msgs/msg/String", encoding=encoding), b"{}", 0.0)
        bag.objects("/silent")
    for topic, reason in {
        "/json": "its messages are encoded as 'json'",
        "/talk": "no message of tracked objects but std_msgs/msg/String",
        "/silent": "it has no message",
    }.items():
        with pytest.raises(RecordingError, match=rf"odd\.mcap, topic {topic}: .*{reason}"):
            read(tmp_path / "odd.mcap", topic=topic)
    with pytest.raises(ConfigurationError, match="--topic is given for the layout 'ind'"):
        load_recordings(tmp_path, "ind", None, ReadingOptions(bags=BagOptions(topic="/x")))
    ego = BagOptions(ego_topic="/odom", ego=EgoOptions(5.0, 2.0))
    with pytest.raises(ConfigurationError, match=r"^--ego-topic is given for the layout 'ind'"):
        load_recordings(tmp_path, "ind", None, ReadingOptions(bags=ego))


def test_a_cloud_that_is_named_objects_but_holds_none_is_not_chosen(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        cloud, tracks = bag.objects("/lidar/objects"), bag.objects("/tracks", kind="autoware")
        store = bag_typestore()
        for i in range(5):
            states = states_at(i / 10)
            message = INPUTS["pointcloud2"].from_states(states, TypestoreTypes(store))
            message.fields = message.fields[1:2]
            data = store.serialize_cdr(message, INPUTS["pointcloud2"].message_type)
            bag.add(cloud, bytes(data), i / 10)
            bag.add(tracks, bytes_of(states, "autoware"), i / 10)
    (recording,) = read(tmp_path / "bag.mcap")
    assert len(recording) == 15


@pytest.mark.parametrize("kind", ["markers", "pointcloud2", "derived"])
def test_a_bag_of_ros_1_is_a_recording(tmp_path, kind):
    store, adapter = get_typestore(Stores.ROS1_NOETIC), INPUTS[kind]
    known = bag_typestore()
    missing = {n: f for n, f in known.fielddefs.items() if n.startswith("derived_object_msgs")}
    store.register(missing)
    with Ros1Writer(tmp_path / "old.bag") as writer:
        topic = writer.add_connection("/objects", adapter.message_type, typestore=store)
        for i in range(10):
            states = states_at(i / 10)
            message = adapter.from_states(states, TypestoreTypes(store))
            data = store.serialize_ros1(message, adapter.message_type)
            writer.write(topic, states.stamp_ns, data)
    (recording,) = read(tmp_path)
    assert (recording.name, len(recording), recording.frame_rate) == ("old", 30, 10.0)
    np.testing.assert_allclose(recording.position[0], [12.0, 0.0])


@pytest.mark.parametrize("language", ["ros2msg", "", "ros2idl"])
def test_a_bag_of_the_earlier_autoware_is_a_recording(tmp_path, language):
    with OddBag(tmp_path / "bag.mcap") as bag:
        text = None if language == "ros2msg" else ("" if not language else "#include <x>\nmodule")
        channel = bag.objects("/tracks", kind="autoware_auto", text=text, language=language)
        for i in range(10):
            bag.add(channel, bytes_of(states_at(i / 10), "autoware_auto"), i / 10)
    (recording,) = read(tmp_path)
    assert len(recording) == 30
    np.testing.assert_allclose(recording.velocity, np.tile([10.0, 0.0], (30, 1)), atol=1e-6)


def test_a_topic_recorded_without_its_slash_can_be_chosen(tmp_path):
    with OddBag(tmp_path / "bag.mcap") as bag:
        channel = bag.objects("objects")
        for i in range(5):
            bag.add(channel, bytes_of(states_at(i / 10)), i / 10)
    for topic in ("", "objects", "/objects"):
        (recording,) = read(tmp_path / "bag.mcap", topic=topic)
        assert len(recording) == 15


def test_what_belongs_to_a_topic_is_in_its_namespace():
    names = ["/b/odom", "/a/loc/odom", "/odom", "/a/tracks/odom"]
    assert nearest_first(names, "/a/tracks/objects") == [
        "/a/tracks/odom",
        "/a/loc/odom",
        "/odom",
        "/b/odom",
    ]
    assert [shared_namespaces(name, "/a/tracks/objects") for name in names] == [0, 1, 0, 2]


def test_a_bag_without_a_message_is_called_so(tmp_path):
    with OddBag(tmp_path / "a.mcap") as bag:
        bag.objects()
    with pytest.raises(RecordingError, match=r"a\.mcap has no message, it has /objects \(sensor"):
        load_recordings(tmp_path, "bag")
