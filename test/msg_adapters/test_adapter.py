# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decoding of malformed messages and of unknown labels."""

from types import SimpleNamespace

import numpy as np
import pytest

from msg_adapters.adapter import Decoded, known_classes
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import ConfigurationError, MessageError

INVALID = [None, "text", -1, float("nan"), [None], SimpleNamespace(), b"\xff"]


def fields_of(message):
    return getattr(message, "__slots__", None) or list(vars(message))


def places(message):
    """Yield (owner, field) of all fields of a message, and of the first element of lists."""
    for name in fields_of(message):
        yield message, name
        content = getattr(message, name)
        inner = content[0] if isinstance(content, list) and content else content
        if hasattr(inner, "__slots__") and not isinstance(inner, (str, bytes)):
            yield from places(inner)


@pytest.mark.parametrize("name", sorted(INPUTS))
def test_an_invalid_field_raises_at_most_a_message_error(name, states, offline, decoded):
    adapter = INPUTS[name]
    message = decoded(adapter.from_states(states, offline), adapter.message_type)["mcap"]
    tried, sentences = 0, []
    for owner, field in places(message):
        kept = getattr(owner, field)
        for value in INVALID:
            setattr(owner, field, value)
            tried += 1
            try:
                adapter.to_states(message, fallback_stamp_ns=1)
            except MessageError as error:
                sentences.append(str(error))
        setattr(owner, field, kept)
    assert tried > 50
    assert len(sentences) > 20
    assert not any("\n" in sentence for sentence in sentences)
    assert len(adapter.to_states(message)) == len(states)


@pytest.mark.parametrize("name", sorted(INPUTS))
def test_a_message_of_another_type(name):
    for value in INVALID:
        with pytest.raises(MessageError, match=f"cannot be read as {INPUTS[name].message_type}"):
            INPUTS[name].to_states(value)


def test_an_unknown_twist_frame_lists_the_known():
    with pytest.raises(ConfigurationError, match=r"'body'.*'object'"):
        INPUTS["pointcloud2"].to_states(None, twist_frame="body")


def test_labels_outside_the_classes_are_unknown():
    labels = np.array([0, 1, 9, 10, 255, -1])
    assert known_classes(labels).tolist() == [0, 1, 9, 0, 0, 0]
    assert known_classes(np.array([2.0, np.nan, np.inf])).tolist() == [2, 0, 0]
    assert known_classes(labels).dtype == np.uint8


def test_objects_left_out_are_added_up_over_the_reasons(states):
    assert Decoded(states).skipped_total == 0
    assert Decoded(states, {"no id": 2, "no position": 3}).skipped_total == 5
