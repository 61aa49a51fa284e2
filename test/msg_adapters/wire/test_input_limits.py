# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages are refused by their first bytes, before they are decoded."""

import dataclasses
import struct

import numpy as np
import pytest

from msg_adapters.registry import INPUTS
from msg_adapters.wire.input_limits import DEFAULT_LIMITS, InputLimits, check_serialized
from mtpgo_core.errors import ConfigurationError, MessageError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states


def message(kind, n, types):
    states = tracked_states(
        1, "a frame", keys_from_integers(range(1, n + 1)), np.zeros((n, 2)), yaw=np.zeros(n)
    )
    return INPUTS[kind].from_states(states, types)


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("frame_id", ["", "abc", "map", "a frame with a long name"])
def test_a_message_of_every_type_passes(kind, frame_id, offline, typestore):
    adapter = INPUTS[kind]
    for n in (0, 1, 5):
        given = message(kind, n, offline)
        if adapter.content.has_header:
            given.header.frame_id = frame_id
        for little_endian in (True, False):
            data = bytes(
                typestore.serialize_cdr(given, adapter.message_type, little_endian=little_endian)
            )
            adapter.check_serialized(data, InputLimits(max_objects=5))
            if n == 5:
                with pytest.raises(MessageError, match="5 objects, expected at most 4"):
                    adapter.check_serialized(data, InputLimits(max_objects=4))


@pytest.mark.parametrize("kind", [kind for kind in INPUTS if INPUTS[kind].content.name])
def test_more_objects_than_the_bytes_can_hold(kind, offline, typestore):
    adapter = INPUTS[kind]
    data = bytearray(typestore.serialize_cdr(message(kind, 0, offline), adapter.message_type))
    place = data.rindex(struct.pack("<I", 0))  # the count, which is the last number
    data[place : place + 4] = struct.pack("<I", 30_000)
    with pytest.raises(MessageError, match="claims 30000 objects"):
        adapter.check_serialized(bytes(data), DEFAULT_LIMITS)


@pytest.mark.parametrize("kind", [kind for kind in INPUTS if INPUTS[kind].content.name])
def test_the_least_size_of_an_object_is_none_too_large(kind, offline, typestore):
    adapter = INPUTS[kind]
    sizes = []
    for n in (0, 1):
        given = message(kind, 0, offline)
        listed = getattr(given, adapter.content.name)
        if n:
            definition = typestore.fielddefs[adapter.message_type][1]
            ((_, inner),) = [k[1][0] for name, k in definition if name == adapter.content.name]
            listed.append(offline.make(inner))
        sizes.append(len(typestore.serialize_cdr(given, adapter.message_type)))
    assert adapter.content.least_bytes <= sizes[1] - sizes[0]


def test_too_many_fields_and_points_of_a_cloud(offline, typestore):
    adapter = INPUTS["pointcloud2"]
    given = message("pointcloud2", 2, offline)
    data = bytes(typestore.serialize_cdr(given, adapter.message_type))
    with pytest.raises(MessageError, match=r"fields, expected at most 5 \(parameter max_fields"):
        adapter.check_serialized(data, InputLimits(max_fields=5))
    given.fields = given.fields * 5
    with pytest.raises(MessageError, match="fields, expected at most 40"):
        adapter.decode(given, limits=InputLimits(max_fields=40))
    given.width = given.height = 1 << 31
    with pytest.raises(MessageError, match="objects, expected at most 32768"):
        adapter.decode(given)


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("length", [0, 1, 4, 11])
def test_bytes_that_end_before_the_counts(kind, length, offline, typestore):
    adapter = INPUTS[kind]
    data = bytes(typestore.serialize_cdr(message(kind, 0, offline), adapter.message_type))
    if length < len(data) - 4:
        with pytest.raises(MessageError, match="ends before its content"):
            check_serialized(data[:length], adapter.content, DEFAULT_LIMITS)


def test_a_large_message_is_refused_by_its_size():
    with pytest.raises(MessageError, match=r"2000 bytes, expected at most 1024 \(parameter max"):
        INPUTS["markers"].check_serialized(bytes(2000), InputLimits(max_message_bytes=1024))


def test_limits_are_checked():
    with pytest.raises(ConfigurationError, match="max_objects is 0"):
        InputLimits(max_objects=0)


@pytest.mark.parametrize("kind", INPUTS)
def test_the_name_of_a_frame_is_bounded(kind, offline):
    """It goes into the header of every marker of the predictions."""
    states = dataclasses.replace(
        tracked_states(1, "", keys_from_integers([1]), np.zeros((1, 2)), yaw=np.zeros(1)),
        frame_id="m" * 256,
    )
    message = INPUTS[kind].from_states(states, offline)
    with pytest.raises(MessageError, match="frame_id has 256 characters, expected at most 255"):
        INPUTS[kind].to_states(message)
