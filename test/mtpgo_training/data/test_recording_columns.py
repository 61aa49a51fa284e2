# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as columns: nothing is lost on the way there and back."""

import dataclasses

import numpy as np
from traffic import braking_cars

from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_columns import pack, unpack

LANES = (np.array([[0.0, 1.0], [2.0, 3.0]]), np.arange(10.0).reshape(5, 2))


def assert_same(one: Recording, other: Recording) -> None:
    for field in dataclasses.fields(Recording):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        elif field.name == "lanes":
            assert len(a) == len(b)
            for line, expected in zip(a, b, strict=True):
                np.testing.assert_array_equal(line, expected)
        else:
            assert a == b, field.name


def test_a_recording_with_everything_comes_back():
    key = np.arange(12, dtype=np.uint32).reshape(3, 4)
    full = dataclasses.replace(
        braking_cars(tracks=3, seconds=1.0), lanes=LANES, ego_id=101, track_key=key
    )
    (back,) = unpack(pack([full]))
    assert_same(back, full)


def test_recordings_are_kept_apart_and_in_order():
    plain = [braking_cars(f"{n:02d}", tracks=n, seconds=1.0, seed=n) for n in (3, 1, 2)]
    plain[1] = dataclasses.replace(plain[1], lanes=LANES[:1], start_time_ns=2**62 + 1)
    for back, expected in zip(unpack(pack(plain)), plain, strict=True):
        assert_same(back, expected)


def test_a_recording_without_rows_comes_back():
    full = braking_cars(tracks=2, seconds=1.0)
    empty = full.select_rows(np.zeros(len(full), dtype=bool))
    (back,) = unpack(pack([empty]))
    assert_same(back, empty)
    assert unpack(pack([])) == []


def test_columns_are_plain_arrays_that_can_be_stored():
    columns = pack([dataclasses.replace(braking_cars(tracks=2, seconds=1.0), lanes=LANES)])
    assert all(type(column) is np.ndarray for column in columns.values())
    assert not any(column.dtype.hasobject for column in columns.values())
    assert columns["0-lane_lengths"].tolist() == [2, 5]
