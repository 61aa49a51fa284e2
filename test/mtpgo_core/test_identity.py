# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Every identity becomes one 128-bit key."""

import hashlib
import uuid

import numpy as np
import pytest

from mtpgo_core.identity import (
    first_key,
    key_to_int,
    key_to_text,
    key_to_uuid_bytes,
    keys_from_integers,
    keys_from_strings,
    keys_from_texts,
    keys_from_uuid_bytes,
)

UUID = uuid.UUID("00112233-4455-6677-8899-aabbccddeeff")


def test_small_numbers_stay_readable():
    keys = keys_from_integers([0, 7, 1 << 32, (1 << 128) - 1])
    full = 0xFFFFFFFF
    assert keys.tolist() == [[0, 0, 0, 0], [7, 0, 0, 0], [0, 1, 0, 0], [full] * 4]
    assert keys.dtype == np.uint32
    assert keys_from_integers([]).shape == (0, 4)


def test_numbers_come_back():
    numbers = [3, 1 << 77, (1 << 128) - 12345]
    assert [key_to_int(k) for k in keys_from_integers(numbers)] == numbers


def test_a_uuid_is_its_number():
    ids = [uuid.UUID("12345678-9abc-def0-1122-334455667788"), uuid.UUID(int=5)]
    raw = np.frombuffer(b"".join(i.bytes for i in ids), dtype=np.uint8)
    keys = keys_from_uuid_bytes(raw.reshape(2, 16))
    assert [key_to_int(k) for k in keys] == [i.int for i in ids]
    assert keys[1].tolist() == [5, 0, 0, 0]


def test_text_is_hashed_the_same_everywhere():
    (key,) = keys_from_strings(["hero"])
    assert key_to_int(key) == int.from_bytes(hashlib.blake2b(b"hero", digest_size=16).digest())
    many = keys_from_strings([f"track_{i}" for i in range(5000)])
    assert len(np.unique(many, axis=0)) == 5000


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


def test_a_key_as_text_leads_back_to_the_key():
    numbers = [0, 17, 2**64 - 1, 2**64, UUID.int, 2**128 - 1]
    texts = [key_to_text(key) for key in keys_from_integers(numbers)]
    assert texts[:3] == ["0", "17", str(2**64 - 1)]
    assert texts[4] == str(UUID)
    np.testing.assert_array_equal(keys_from_texts(texts), keys_from_integers(numbers))


def test_the_first_text_that_is_not_blank_is_chosen():
    assert key_to_int(first_key(" ", "17 ", "18")) == 17
    assert key_to_int(first_key("5", "")) == 5
    assert first_key("", " ") is None
    assert first_key() is None
