# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Any identity becomes one 128-bit key."""

import hashlib
import uuid

import numpy as np

from mtpgo_core.identity import (
    key_to_int,
    keys_from_integers,
    keys_from_strings,
    keys_from_uuid_bytes,
)


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
