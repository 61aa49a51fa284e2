# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The message definitions: complete, ordered, and usable by a typestore."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msg_adapters.registry import INPUTS, OUTPUTS
from msg_adapters.wire.definitions import DEFINITIONS


def test_registered_messages_can_all_be_made(offline, typestore):
    for name in DEFINITIONS:
        typestore.serialize_cdr(offline.make(name), name)


def test_each_supported_type_is_jazzys_own_or_defined_here():
    jazzy = get_typestore(Stores.ROS2_JAZZY).types
    for adapter in (*INPUTS.values(), *OUTPUTS.values()):
        assert adapter.message_type in jazzy or adapter.message_type in DEFINITIONS


def test_inner_types_are_defined_before_those_that_hold_them():
    known = set(get_typestore(Stores.ROS2_JAZZY).types)
    for name, text in DEFINITIONS.items():
        for found, (_, fields) in get_types_from_msg(text, name).items():
            for _, (kind, content) in fields:
                inner = content[0] if kind.name in ("ARRAY", "SEQUENCE") else (kind, content)
                if inner[0].name == "NAME":
                    assert inner[1] in known, f"{found} needs {inner[1]}"
            known.add(found)


@pytest.mark.parametrize("name", ["autoware", "vision", "derived", "ika"])
def test_a_message_survives_the_round_trip_through_bytes(name, states, offline, typestore):
    adapter = INPUTS[name]
    data = typestore.serialize_cdr(adapter.from_states(states, offline), adapter.message_type)
    again = typestore.deserialize_cdr(data, adapter.message_type)
    assert bytes(typestore.serialize_cdr(again, adapter.message_type)) == bytes(data)
