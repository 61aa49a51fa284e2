# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Point clouds as structured arrays: layouts of other publishers, and the round trip."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.wire.cloud import cloud_to_records, records_to_cloud
from mtpgo_core.errors import MessageError

CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
"""Numbers of the datatypes in sensor_msgs/PointField."""


def cloud(fields, data, point_step, **changes):
    """A cloud with (name, offset, datatype, count) fields and given bytes."""
    values = {
        "height": 1,
        "width": len(data) // point_step,
        "fields": [
            SimpleNamespace(name=n, offset=o, datatype=d, count=c) for n, o, d, c in fields
        ],
        "is_bigendian": False,
        "point_step": point_step,
        "row_step": len(data),
        "data": data,
    }
    return SimpleNamespace(**(values | changes))


@pytest.mark.parametrize("order", ["<", ">"])
def test_all_datatypes_in_both_byte_orders(order):
    layout = np.dtype([(code, order + code) for code in CODES])
    given = np.zeros(3, dtype=layout)
    for i, code in enumerate(CODES):
        given[code] = np.arange(3) + i
    fields = [(code, layout.fields[code][1], CODES[code], 1) for code in CODES]
    message = cloud(fields, given.tobytes(), layout.itemsize, is_bigendian=order == ">")
    found = cloud_to_records(message)
    for code in CODES:
        np.testing.assert_array_equal(found[code], given[code])


def test_rows_of_an_organised_cloud_follow_each_other_without_their_padding():
    data = b"".join(struct.pack("<ff", row, 2.0 * row) + b"\xff" * 4 for row in range(3))
    message = cloud([("x", 0, 7, 1)], data, 4, height=3, width=2, row_step=12)
    np.testing.assert_array_equal(cloud_to_records(message)["x"], [0, 0, 1, 2, 2, 4])


def test_the_last_row_may_lack_its_padding():
    data = struct.pack("<ff4xff", 1.0, 2.0, 3.0, 4.0)
    message = cloud([("x", 0, 7, 1)], data, 4, height=2, width=2, row_step=12)
    np.testing.assert_array_equal(cloud_to_records(message)["x"], [1, 2, 3, 4])


def test_a_single_row_may_leave_its_row_step_unset():
    message = cloud([("x", 0, 7, 1)], struct.pack("<ff", 1.0, 2.0), 4, row_step=0)
    np.testing.assert_array_equal(cloud_to_records(message)["x"], [1.0, 2.0])


def test_fields_of_several_numbers_are_left_out_and_a_count_of_zero_is_one():
    data = struct.pack("<f3f", 1.0, 2.0, 3.0, 4.0)
    message = cloud([("x", 0, 7, 0), ("rgb", 4, 7, 3)], data, 16)
    assert cloud_to_records(message).dtype.names == ("x",)


@pytest.mark.parametrize("kind", [bytes, bytearray, list, lambda data: np.frombuffer(data, "u1")])
def test_the_data_may_be_any_sequence_of_bytes(kind):
    message = cloud([("x", 0, 7, 1)], struct.pack("<f", 5.0), 4)
    message.data = kind(message.data)
    assert cloud_to_records(message)["x"].tolist() == [5.0]


def test_an_empty_cloud_needs_no_data():
    message = cloud([("x", 0, 7, 1)], b"", 4, width=0)
    assert cloud_to_records(message).shape == (0,)


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (cloud([("x", 2, 7, 1)], bytes(4), 4), "'x' ends at byte 6, expected at most point_step"),
        (cloud([("x", 0, 9, 1)], bytes(4), 4), "'x' has datatype 9, expected 1 to 8"),
        (cloud([("x", 0, 7, 1)], bytes(7), 4, width=2), "7 bytes of data, expected 8 for 1 x 2"),
        (cloud([("x", 0, 7, 1)] * 2, bytes(4), 4), "two fields of the name 'x'"),
        (
            cloud([("x", 0, 7, 1)], bytes(4), 2**32 - 1),
            "point_step 4294967295, expected at most 2147483647",
        ),
        (
            cloud([("x", 0, 7, 1)], bytes(16), 4, height=2, width=2, row_step=7),
            "row_step 7, expected at least width x point_step = 8",
        ),
    ],
)
def test_a_layout_that_does_not_fit_is_named(message, sentence):
    with pytest.raises(MessageError) as error:
        cloud_to_records(message)
    assert sentence in str(error.value)


def test_records_survive_the_round_trip(offline):
    layout = np.dtype({"names": ["x", "id"], "formats": ["<f8", "<u4"], "offsets": [0, 12]})
    given = np.zeros(2, dtype=layout)
    given["x"], given["id"] = [1.5, np.nan], [7, 2**32 - 1]
    message = records_to_cloud(given, offline, stamp_ns=5, frame_id="map", is_dense=False)
    assert (message.height, message.width, message.point_step, message.row_step) == (1, 2, 16, 32)
    assert [(f.name, f.offset, f.datatype, f.count) for f in message.fields] == [
        ("x", 0, 8, 1),
        ("id", 12, 6, 1),
    ]
    found = cloud_to_records(message)
    for name in ("x", "id"):
        np.testing.assert_array_equal(found[name], given[name])
