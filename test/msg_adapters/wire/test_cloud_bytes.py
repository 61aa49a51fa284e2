# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A PointCloud2 read from its bytes, without a message class."""

import numpy as np
import pytest

from msg_adapters.registry import INPUTS
from msg_adapters.wire.cloud import cloud_to_records
from msg_adapters.wire.cloud_bytes import cloud_from_cdr
from mtpgo_core.errors import MessageError

TYPE = "sensor_msgs/msg/PointCloud2"


@pytest.mark.parametrize("little_endian", [True, False])
def test_every_field_is_that_of_the_message(states, offline, typestore, little_endian):
    message = INPUTS["pointcloud2"].from_states(states, offline)
    data = bytes(typestore.serialize_cdr(message, TYPE, little_endian=little_endian))
    for given in (data, bytearray(data), memoryview(data), np.frombuffer(data, np.uint8)):
        found = cloud_from_cdr(given)
        assert found.header.frame_id == "map"
        assert found.header.stamp.sec * 10**9 + found.header.stamp.nanosec == states.stamp_ns
        for name in ("height", "width", "is_bigendian", "point_step", "row_step", "is_dense"):
            assert getattr(found, name) == getattr(message, name), name
        fields = [(f.name, f.offset, f.datatype, f.count) for f in found.fields]
        assert fields == [(f.name, f.offset, f.datatype, f.count) for f in message.fields]
        np.testing.assert_array_equal(cloud_to_records(found), cloud_to_records(message))


def test_what_is_no_cloud_is_refused_with_what_it_is(states, offline, typestore):
    message = INPUTS["pointcloud2"].from_states(states, offline)
    data = bytes(typestore.serialize_cdr(message, TYPE))
    for given, words in {
        b"": "has 0 bytes, expected at least 4",
        b"\x00\x03\x00\x00" + data[4:]: "encoding 0x0003, expected plain CDR",
        data[:60]: "claims 25 fields, expected at most",
        data[:-50]: "is cut off",
    }.items():
        with pytest.raises(MessageError, match=words):
            cloud_from_cdr(given)
    with pytest.raises(MessageError, match="is a str, expected bytes"):
        cloud_from_cdr("text")


def test_more_fields_than_any_layout_are_refused(offline, typestore):
    field = offline.make("sensor_msgs/msg/PointField", name="f", offset=0, datatype=2, count=1)
    message = offline.make(TYPE, fields=[field] * 257)
    with pytest.raises(MessageError, match="has 257 fields, expected at most 256"):
        cloud_from_cdr(bytes(typestore.serialize_cdr(message, TYPE)))
