# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Adapters by name, and the bytes they write against messages serialised by rosbags."""

import dataclasses
import time

import numpy as np
import pytest

from msg_adapters.registry import INPUTS, OUTPUTS, adapter_for_type, input_adapter, output_adapter
from mtpgo_core.errors import ConfigurationError, MessageError

KINDS = ["markers", "autoware"]


@pytest.fixture(params=["", "m", "map", "odom/enu", "Straße"])
def frame_id(request):
    """Names whose lengths put the next field at every alignment."""
    return request.param


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("agents", [0, 1, 3])
def test_bytes_are_those_of_the_message(kind, agents, frame_id, prediction, offline, typestore):
    output = OUTPUTS[kind]
    shared = ("stamp_ns", "frame_id", "time_s")
    fields = [f.name for f in dataclasses.fields(prediction) if f.name not in shared]
    some = dataclasses.replace(
        prediction, frame_id=frame_id, **{n: getattr(prediction, n)[:agents] for n in fields}
    )
    objects = output.writer(offline, max_modes=3)
    octets = output.writer(offline, max_modes=3, serialized=True)
    for part in (prediction, some, prediction):  # markers of the first are deleted in the second
        wanted = bytes(typestore.serialize_cdr(objects(part), output.message_type))
        # Nothing but padding may follow the last field.
        assert octets(part).rstrip(b"\0") == wanted.rstrip(b"\0")


def test_rclpy_reads_the_bytes(prediction, online, typestore):
    serialization = pytest.importorskip("rclpy.serialization")
    name = OUTPUTS["markers"].message_type
    data = OUTPUTS["markers"].writer(online, serialized=True)(prediction)
    found = serialization.deserialize_message(data, online.message_class(name))
    wanted = OUTPUTS["markers"].writer(online)(prediction)

    def settled(message):
        """Bytes without the middleware's padding, which is not always zero."""
        again = typestore.deserialize_cdr(serialization.serialize_message(message), name)
        return bytes(typestore.serialize_cdr(again, name))

    assert settled(found) == settled(wanted)


def test_an_output_without_a_byte_writer_gives_the_message(prediction, offline):
    output = OUTPUTS["pointcloud2"]
    message = output.writer(offline, serialized=True)(prediction)
    assert message.point_step == 88


@pytest.mark.parametrize("kind", KINDS)
def test_bytes_are_faster(kind, prediction, offline, typestore):
    many = {
        f.name: np.repeat(getattr(prediction, f.name), 20, axis=0)
        for f in dataclasses.fields(prediction)
        if f.name not in ("stamp_ns", "frame_id", "time_s", "key")
    }
    rng = np.random.default_rng(0)
    key = rng.integers(0, 2**32, size=(60, 4), dtype=np.uint32)
    crowd = dataclasses.replace(prediction, key=key, **many)
    output = OUTPUTS[kind]

    def best(write):
        times = []
        for _ in range(5):
            start = time.perf_counter()
            write()
            times.append(time.perf_counter() - start)
        return min(times)

    objects, octets = output.writer(offline), output.writer(offline, serialized=True)
    slow = best(lambda: typestore.serialize_cdr(objects(crowd), output.message_type))
    assert best(lambda: octets(crowd)) < slow


def test_a_publisher_takes_the_bytes(prediction, online):
    rclpy = pytest.importorskip("rclpy")
    from rclpy.executors import SingleThreadedExecutor

    output = OUTPUTS["markers"]
    kind = online.message_class(output.message_type)
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("bytes_test", context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        received = []
        node.create_subscription(kind, "markers", received.append, 5)
        publisher = node.create_publisher(kind, "markers", 5)
        deadline = time.monotonic() + 30.0
        while publisher.get_subscription_count() == 0 and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.05)
        publisher.publish(output.writer(online, serialized=True)(prediction))
        while not received and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.05)
        executor.shutdown()
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    wanted = output.writer(online)(prediction)
    assert [(m.ns, m.id, len(m.points)) for m in received[0].markers] == [
        (m.ns, m.id, len(m.points)) for m in wanted.markers
    ]


def test_an_unknown_input_lists_the_known():
    with pytest.raises(ConfigurationError, match=r"'pointcloud'.*'pointcloud2'"):
        input_adapter("pointcloud")
    with pytest.raises(MessageError, match=r"sensor_msgs/msg/Image.*sensor_msgs/msg/PointCloud2"):
        adapter_for_type("sensor_msgs/msg/Image")
    assert adapter_for_type("sensor_msgs/PointCloud2") is INPUTS["pointcloud2"]


def test_an_unknown_output_lists_the_known():
    with pytest.raises(ConfigurationError, match=r"'cloud'.*'pointcloud2', 'markers', 'autoware'"):
        output_adapter("cloud")


def test_a_type_may_be_written_with_or_without_msg():
    for adapter in INPUTS.values():
        package, _, name = adapter.message_type.partition("/msg/")
        assert adapter_for_type(adapter.message_type) is adapter
        assert adapter_for_type(f"{package}/{name}") is adapter
    for odd in ("", "PointCloud2", "sensor_msgs/", "sensor_msgs/srv/PointCloud2"):
        with pytest.raises(MessageError, match="carries no tracked objects"):
            adapter_for_type(odd)


def test_each_adapter_has_its_own_name_and_type():
    for adapters in (INPUTS, OUTPUTS):
        assert all(name == adapter.name for name, adapter in adapters.items())
        types = [adapter.message_type for adapter in adapters.values()]
        assert len(set(types)) == len(types)
        assert all(a.message_type.startswith(f"{a.package}/msg/") for a in adapters.values())
