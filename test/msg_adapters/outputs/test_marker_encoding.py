# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Markers as bytes against the same markers as a message."""

import numpy as np
import pytest

from msg_adapters.outputs.marker_encoding import (
    DELETE,
    MARKER_ARRAY,
    TEXT,
    Drawn,
    markers_to_cdr,
    markers_to_message,
)


@pytest.mark.parametrize("frame_id", ["", "m", "map", "odom/enu", "Straße"])
def test_labels_points_and_every_alignment(frame_id, offline, typestore):
    rng = np.random.default_rng(0)
    drawn = [
        Drawn(ns=text, number=i, yaw=0.3, points=rng.normal(size=(i % 3, 3)), text=text[::-1])
        for i, text in enumerate(["", "a", "ab", "abc", "abcd", "abcde", "naïve", "x" * 50])
    ]
    arguments = {"stamp_ns": 1_234_567_891_234_567_891, "frame_id": frame_id, "lifetime_s": 0.75}
    message = markers_to_message(drawn, offline, **arguments)
    wanted = bytes(typestore.serialize_cdr(message, MARKER_ARRAY))
    assert markers_to_cdr(drawn, **arguments).rstrip(b"\0") == wanted.rstrip(b"\0")


def test_each_field_of_a_marker_arrives(offline, typestore):
    """Numbers that float32 holds exactly, since a marker's colour is float32."""
    drawn = Drawn(
        ns="agents",
        number=7,
        kind=TEXT,
        action=DELETE,
        position=(1.0, -2.0, 3.0),
        yaw=np.pi,
        scale=(4.0, 5.0, 6.0),
        colour=(0.25, 0.5, 0.75, 1.0),
        points=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        text="car 7",
    )
    data = markers_to_cdr([drawn], stamp_ns=2_000_000_003, frame_id="map", lifetime_s=1.5)
    (marker,) = typestore.deserialize_cdr(data, MARKER_ARRAY).markers
    assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (2, 3)
    assert (marker.header.frame_id, marker.ns, marker.id) == ("map", "agents", 7)
    assert (marker.type, marker.action, marker.text) == (TEXT, DELETE, "car 7")
    position, turned = marker.pose.position, marker.pose.orientation
    assert (position.x, position.y, position.z) == (1.0, -2.0, 3.0)
    found = (turned.x, turned.y, turned.z, turned.w)
    assert found == pytest.approx((0.0, 0.0, 1.0, 0.0), abs=1e-12)
    assert (marker.scale.x, marker.scale.y, marker.scale.z) == (4.0, 5.0, 6.0)
    colour = marker.color
    assert (colour.r, colour.g, colour.b, colour.a) == (0.25, 0.5, 0.75, 1.0)
    assert (marker.lifetime.sec, marker.lifetime.nanosec) == (1, 500_000_000)
    assert [(p.x, p.y, p.z) for p in marker.points] == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]


def test_no_markers_are_an_empty_array(offline, typestore):
    data = markers_to_cdr([], stamp_ns=1, frame_id="map", lifetime_s=1.0)
    assert len(typestore.deserialize_cdr(data, MARKER_ARRAY).markers) == 0
    message = markers_to_message([], offline, stamp_ns=1, frame_id="map", lifetime_s=1.0)
    assert list(message.markers) == []
