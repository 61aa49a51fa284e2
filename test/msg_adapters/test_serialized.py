# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes written directly against the same message made of objects and serialised by rosbags."""

import dataclasses
import time

import numpy as np
import pytest

from msg_adapters.outputs.marker_encoding import Drawn, markers_to_cdr, markers_to_message
from msg_adapters.registry import OUTPUTS
from msg_adapters.wire.cdr import CdrWriter

KINDS = ["markers", "autoware"]


@pytest.fixture(params=["", "m", "map", "odom/enu", "Straße"])
def frame_id(request):
    """Lengths that put what follows at every alignment."""
    return request.param


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("agents", [0, 1, 3])
def test_bytes_say_the_same(kind, agents, frame_id, prediction, offline, typestore):
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


def test_labels_points_and_every_alignment(frame_id, offline, typestore):
    rng = np.random.default_rng(0)
    drawn = [
        Drawn(ns=text, number=i, yaw=0.3, points=rng.normal(size=(i % 3, 3)), text=text[::-1])
        for i, text in enumerate(["", "a", "ab", "abc", "abcd", "abcde", "naïve", "x" * 50])
    ]
    arguments = {"stamp_ns": 1_234_567_891_234_567_891, "frame_id": frame_id, "lifetime_s": 0.75}
    message = markers_to_message(drawn, offline, **arguments)
    name = "visualization_msgs/msg/MarkerArray"
    wanted = bytes(typestore.serialize_cdr(message, name))
    assert markers_to_cdr(drawn, **arguments).rstrip(b"\0") == wanted.rstrip(b"\0")


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


def test_kinds_without_a_faster_way_give_the_message(prediction, offline):
    output = OUTPUTS["pointcloud2"]
    message = output.writer(offline, serialized=True)(prediction)
    assert message.point_step == 64


def test_alignment_by_hand():
    writer = CdrWriter()
    writer.pack(1, "B", 1)
    writer.text("ab")
    writer.doubles(np.array([1.0]))
    writer.block(1, b"z")
    writer.pack(2, "H", 5)
    assert bytes(writer)[4:] == writer.content
    assert bytes(writer) == (
        b"\x00\x01\x00\x00"
        b"\x01\x00\x00\x00"
        b"\x03\x00\x00\x00ab\x00\x00"
        b"\x00\x00\x00\x00"
        b"\x00\x00\x00\x00\x00\x00\xf0\x3f"
        b"z\x00\x05\x00"
    )


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
