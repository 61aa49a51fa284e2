# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracked objects in a PointCloud2: round trip, layouts of other publishers, errors."""

import dataclasses
import struct
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.inputs.object_cloud import COVARIANCE_FIELDS
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import tracked_states

ADAPTER = INPUTS["pointcloud2"]


def field(name, offset, datatype, count=1):
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


def cloud(fields, data, point_step, **changes):
    """A cloud written byte by byte, so that nothing of the encoder under test is used."""
    values = {
        "header": SimpleNamespace(stamp=SimpleNamespace(sec=12, nanosec=5), frame_id="odom"),
        "height": 1,
        "width": len(data) // point_step if point_step else 0,
        "fields": fields,
        "is_bigendian": False,
        "point_step": point_step,
        "row_step": len(data),
        "data": data,
        "is_dense": True,
    }
    return SimpleNamespace(**(values | changes))


def test_round_trip_through_cdr_and_three_decoders(states, offline, decoded, assert_equal):
    message = ADAPTER.from_states(states, offline)
    for reader, again in decoded(message, ADAPTER.message_type, with_rclpy=True).items():
        found = ADAPTER.to_states(again)
        assert_equal(found, states)
        np.testing.assert_array_equal(found.position, states.position, reader)


def test_rclpy_classes_with_field_checks(states, online, typestore, assert_equal):
    serialization = pytest.importorskip("rclpy.serialization")
    message = ADAPTER.from_states(states, online)
    data = serialization.serialize_message(message)
    assert_equal(ADAPTER.to_states(message), states)
    assert_equal(ADAPTER.to_states(typestore.deserialize_cdr(data, ADAPTER.message_type)), states)


def test_unknown_values_survive_and_covariance_is_left_out(offline, assert_equal):
    states = tracked_states(5, "map", np.eye(4, dtype=np.uint32), np.zeros((4, 2)))
    message = ADAPTER.from_states(states, offline)
    assert not any(f.name in COVARIANCE_FIELDS for f in message.fields)
    assert not message.is_dense
    assert_equal(ADAPTER.to_states(message), states)


def test_empty_cloud_keeps_stamp_and_frame(offline, decoded, assert_equal):
    states = tracked_states(7, "map", np.empty((0, 4), np.uint32), np.empty((0, 2)))
    message = ADAPTER.from_states(states, offline)
    for again in decoded(message, ADAPTER.message_type, with_rclpy=True).values():
        assert_equal(ADAPTER.to_states(again), states)


def test_only_the_three_required_fields_float32_and_padding():
    point = struct.pack("<f4xfI", 1.5, -2.5, 9)
    message = cloud([field("x", 0, 7), field("y", 8, 7), field("id_0", 12, 6)], point * 2, 16)
    states = ADAPTER.to_states(message)
    np.testing.assert_array_equal(states.position, [[1.5, -2.5]] * 2)
    np.testing.assert_array_equal(states.key, [[9, 0, 0, 0]] * 2)
    assert states.stamp_ns == 12_000_000_005
    assert states.frame_id == "odom"
    assert (states.agent_class == 0).all()
    for unknown in (states.velocity, states.yaw, states.size, states.covariance, states.z):
        assert np.isnan(unknown).all()


def test_big_endian_two_rows_with_row_padding_and_other_fields():
    rows = b""
    for row in range(2):
        for column in range(3):
            rows += struct.pack(">ddI3f", row, column, 10 * row + column, 1.0, 2.0, 3.0)
        rows += b"\xff" * 7
    fields = [
        field("x", 0, 8),
        field("y", 8, 8),
        field("id_0", 16, 6),
        field("rgb", 20, 7, count=3),
    ]
    message = cloud(fields, rows, 32, is_bigendian=True, height=2, width=3, row_step=3 * 32 + 7)
    states = ADAPTER.to_states(message)
    np.testing.assert_array_equal(
        states.position, [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]
    )
    np.testing.assert_array_equal(states.key[:, 0], [0, 1, 2, 10, 11, 12])


def test_object_frame_turns_velocity_by_yaw():
    data = struct.pack("<ffIfff", 0.0, 0.0, 1, 10.0, 1.0, np.pi / 2)
    fields = [field(n, o, 7) for n, o in (("x", 0), ("y", 4), ("vx", 12), ("vy", 16), ("yaw", 20))]
    message = cloud([*fields, field("id_0", 8, 6)], data, 24)
    np.testing.assert_allclose(ADAPTER.to_states(message).velocity, [[10.0, 1.0]])
    turned = ADAPTER.to_states(message, twist_frame="object").velocity
    np.testing.assert_allclose(turned, [[-1.0, 10.0]], atol=1e-6)


def test_object_frame_turns_the_covariances_of_velocities_with_them(states, offline):
    """As in the other messages: only the position's covariance is in the frame of the header."""
    own = np.diag([1.0, 4.0, 9.0, 0.25])
    own[0, 2] = own[2, 0] = 0.6  # along x and along the box
    heading = np.array([np.pi / 2, 0.0, np.pi / 4, 0.0, np.nan])
    sent = dataclasses.replace(states, covariance=np.tile(own, (5, 1, 1)), yaw=heading)
    message = ADAPTER.from_states(sent, offline)
    header, found = (
        ADAPTER.to_states(message, twist_frame=frame).covariance for frame in ("header", "object")
    )
    np.testing.assert_allclose(header, sent.covariance, rtol=1e-6)
    np.testing.assert_allclose(found[0, 2:, 2:], np.diag([0.25, 9.0]), atol=1e-6)
    np.testing.assert_allclose(found[0, :2, 2:], [[0.0, 0.6], [0.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(found[1], own, rtol=1e-6)
    np.testing.assert_allclose(found[:, :2, :2], sent.covariance[:, :2, :2], rtol=1e-6)
    np.testing.assert_allclose(found[0], found[0].T)
    assert np.isnan(found[4, 2:, 2:]).all()  # without a heading the direction is not known


def test_infinity_zero_size_and_unknown_class_are_unknown(states, offline):
    n = len(states)
    velocity = np.full((n, 2), np.inf)
    odd = dataclasses.replace(
        states,
        velocity=velocity,
        size=np.zeros((n, 2)),
        agent_class=np.array([250, 10, 9, 8, 0], dtype=np.uint8),
    )
    found = ADAPTER.to_states(ADAPTER.from_states(odd, offline))
    assert np.isnan(found.velocity).all()
    assert np.isnan(found.size).all()
    np.testing.assert_array_equal(found.agent_class, [0, 0, 9, 8, 0])


XY_ID = [field("x", 0, 7), field("y", 4, 7), field("id_0", 8, 6)]


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (cloud(XY_ID[:2], b"\0" * 12, 12), r"lacks the field id_0 .* fields are x, y"),
        (cloud([field("x", 0, 7), field("i\nd", 4, 7)], b"\0" * 8, 8), r"fields are x, 'i\\nd'$"),
        (cloud(XY_ID, b"\0" * 20, 12, width=2), "has 20 bytes of data, expected 24"),
        (cloud([*XY_ID, field("z", 12, 8)], b"\0" * 12, 12), "'z' ends at byte 20"),
        (cloud([*XY_ID, field("x", 0, 7)], b"\0" * 12, 12), "two fields of the name 'x'"),
        (cloud([*XY_ID, field("z", 0, 77)], b"\0" * 12, 12), "'z' has datatype 77"),
        (cloud([*XY_ID[:2], field("id_0", 8, 7)], b"\0" * 12, 12), "'id_0' is not an integer"),
        (
            cloud(XY_ID, b"\0" * 48, 12, width=2, height=2, row_step=12),
            "row_step 12, expected at least width x point_step = 24",
        ),
        (
            cloud([*XY_ID, field("mode", 12, 2), field("step", 13, 2)], b"\0" * 14, 14),
            "holds predictions",
        ),
        (SimpleNamespace(header=None), "cannot be read as sensor_msgs/msg/PointCloud2"),
    ],
)
def test_malformed_cloud_gets_one_sentence(message, sentence):
    with pytest.raises(MessageError, match=sentence) as error:
        ADAPTER.to_states(message)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["mode", "step"])
def test_a_further_field_of_a_tracker_is_no_prediction(name):
    data = struct.pack("<ffIB", 3.0, 4.0, 7, 1)
    found = ADAPTER.to_states(cloud([*XY_ID, field(name, 12, 2)], data, 13))
    assert found.position.tolist() == [[3.0, 4.0]]


def test_thousand_objects_decode_in_a_few_ms(offline):
    import time

    n = 1000
    key = np.zeros((n, 4), np.uint32)
    key[:, 0] = np.arange(n)
    message = ADAPTER.from_states(tracked_states(1, "map", key, np.zeros((n, 2))), offline)
    best = min(_timed(lambda: ADAPTER.to_states(message), time.perf_counter) for _ in range(10))
    assert best < 0.02


def _timed(call, clock):
    start = clock()
    call()
    return clock() - start
