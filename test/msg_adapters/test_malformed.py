# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever stands in a message, an adapter answers with one sentence and nothing else."""

from types import SimpleNamespace

import pytest

from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError

RUBBISH = [None, "text", -1, float("nan"), [None], SimpleNamespace(), b"\xff"]


def fields_of(message):
    return getattr(message, "__slots__", None) or list(vars(message))


def places(message, depth=0):
    """(owner, field) of everything inside a decoded message, down into first elements of lists."""
    for name in fields_of(message):
        yield message, name
        value = getattr(message, name)
        inner = value[0] if isinstance(value, list) and value else value
        if hasattr(inner, "__slots__") and not isinstance(inner, (str, bytes)):
            yield from places(inner, depth + 1)


@pytest.mark.parametrize("name", sorted(INPUTS))
def test_any_field_may_be_invalid(name, states, offline, decoded):
    adapter = INPUTS[name]
    message = decoded(adapter.from_states(states, offline), adapter.message_type)["mcap"]
    tried, sentences = 0, []
    for owner, field in places(message):
        kept = getattr(owner, field)
        for rubbish in RUBBISH:
            setattr(owner, field, rubbish)
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
    for rubbish in RUBBISH:
        with pytest.raises(MessageError, match=f"cannot be read as {INPUTS[name].message_type}"):
            INPUTS[name].to_states(rubbish)
