# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane markings from a MarkerArray."""

import numpy as np
import pytest

from msg_adapters.inputs.lane_markers import (
    MOST_BYTES,
    check_serialized,
    lanes_from_markers,
    lanes_to_markers,
)
from mtpgo_core.errors import MessageError

TYPE = "visualization_msgs/msg/MarkerArray"
LINES = (
    np.array([[0.0, 1.0], [100.0, 1.5], [200.0, -3.0]]),
    np.array([[0.1, 0.2], [0.3, 0.4]]),
)


def test_round_trip(offline, online, decoded, typestore):
    for types in (offline, online):
        message = lanes_to_markers(LINES, types, stamp_ns=5, frame_id="map")
        if types is online:
            serialization = pytest.importorskip("rclpy.serialization")
            messages = [typestore.deserialize_cdr(serialization.serialize_message(message), TYPE)]
        else:
            messages = decoded(message, TYPE, with_rclpy=True).values()
        for again in messages:
            found = lanes_from_markers(again)
            assert found.frame_id == "map"
            for line, wanted in zip(found.polylines, LINES, strict=True):
                np.testing.assert_array_equal(line, wanted)


def test_a_message_without_lines(offline, decoded):
    message = lanes_to_markers([], offline, stamp_ns=5, frame_id="map")
    for again in decoded(message, TYPE, with_rclpy=True).values():
        assert lanes_from_markers(again).polylines == ()


def test_pose_line_lists_and_markers_that_are_left_out(offline):
    message = lanes_to_markers([*LINES, LINES[0], LINES[0]], offline, stamp_ns=5, frame_id="map")
    moved, pairs, deleted, broken = message.markers
    moved.pose = offline.make(
        "geometry_msgs/msg/Pose",
        position=offline.make("geometry_msgs/msg/Point", x=10.0, y=0.0, z=0.0),
        orientation=offline.make(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(np.pi / 4), w=np.cos(np.pi / 4)
        ),
    )
    pairs.type = 5
    pairs.points = [*pairs.points, *moved.points]  # five points: two segments, one left over
    deleted.action = 2
    broken.points[0].x = broken.points[1].x = np.nan
    found = lanes_from_markers(message).polylines
    assert len(found) == 3
    np.testing.assert_allclose(found[0], [[9.0, 0.0], [8.5, 100.0], [13.0, 200.0]], atol=1e-12)
    np.testing.assert_array_equal(found[1], LINES[1])
    np.testing.assert_array_equal(found[2], LINES[0][:2])


def test_two_frames_and_other_messages_are_refused(offline):
    message = lanes_to_markers(LINES, offline, stamp_ns=5, frame_id="map")
    message.markers[1].header = offline.make("std_msgs/msg/Header", frame_id="odom")
    with pytest.raises(MessageError, match="frames 'map', 'odom'"):
        lanes_from_markers(message)
    with pytest.raises(MessageError, match="cannot be read as lane markings"):
        lanes_from_markers(object())


def test_places_beyond_belief_are_left_out_and_leaps_are_refused(offline):
    line = np.array([[0.0, 1.0], [1e9, 1.0], [50.0, 1.0], [1e300, 0.0], [np.inf, 0.0]])
    message = lanes_to_markers([line], offline, stamp_ns=5, frame_id="map")
    (found,) = lanes_from_markers(message).polylines
    np.testing.assert_array_equal(found, [[0.0, 1.0], [50.0, 1.0]])
    # A grid of the segments of such a line would take seconds and hundreds of megabytes.
    far = lanes_to_markers([np.array([[0.0, 1.0], [1e7, 1.0]])], offline, stamp_ns=5, frame_id="")
    with pytest.raises(
        MessageError, match=r"points that are 1e\+04 km apart, expected at most 20"
    ):
        lanes_from_markers(far)


def test_bytes_are_checked_before_they_are_decoded(offline, typestore):
    message = lanes_to_markers(LINES, offline, stamp_ns=5, frame_id="map")
    data = bytearray(typestore.serialize_cdr(message, TYPE))
    check_serialized(bytes(data))
    check_serialized(
        bytes(
            typestore.serialize_cdr(lanes_to_markers([], offline, stamp_ns=5, frame_id=""), TYPE)
        )
    )
    for claimed, words in ((10_001, "10001 markers, expected at most 10000"), (99, "claims 99")):
        data[4:8] = claimed.to_bytes(4, "little")
        with pytest.raises(MessageError, match=words):
            check_serialized(bytes(data))
    with pytest.raises(MessageError, match="bytes, expected at most 8388608"):
        check_serialized(bytes(MOST_BYTES + 1))
