# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
import uuid

import numpy as np
import pytest

from mtpgo_core.identity import (
    key_to_int,
    key_to_uuid_bytes,
    keys_from_integers,
    keys_from_strings,
    keys_from_texts,
    keys_from_uuid_bytes,
)

UUID = uuid.UUID("00112233-4455-6677-8899-aabbccddeeff")


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("0", 0),
        ("17", 17),
        (str(2**128 - 1), 2**128 - 1),
        (str(UUID), UUID.int),
        (UUID.hex, UUID.int),
    ],
)
def test_numbers_and_uuids_name_what_they_say(text, number):
    np.testing.assert_array_equal(keys_from_texts([text]), keys_from_integers([number]))


@pytest.mark.parametrize("text", ["", "007", "+7", "-7", "٣", str(2**128), "9" * 5000, "z" * 32])
def test_other_text_is_hashed(text):
    np.testing.assert_array_equal(keys_from_texts([text]), keys_from_strings([text]))


def test_order_is_kept_in_a_mixture():
    found = keys_from_texts(["truck", "5", str(UUID), "bus"])
    wanted = [
        keys_from_strings(["truck"]),
        keys_from_integers([5]),
        keys_from_integers([UUID.int]),
        keys_from_strings(["bus"]),
    ]
    np.testing.assert_array_equal(found, np.concatenate(wanted))
    assert keys_from_texts([]).shape == (0, 4)


def test_uuid_bytes_round_trip():
    key = keys_from_uuid_bytes(np.frombuffer(UUID.bytes, dtype=np.uint8))[0]
    assert key_to_uuid_bytes(key) == UUID.bytes
    assert key_to_int(key) == UUID.int
