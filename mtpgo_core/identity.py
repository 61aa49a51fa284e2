# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A 128-bit key for the identities of any tracker.

An unsigned integer fills the lower words (id_0 is the least significant), so small track numbers
remain readable in the output. A UUID is its sixteen bytes, big-endian, word id_3 first. A string
is hashed (BLAKE2b, 128 bits).
"""

from __future__ import annotations

import contextlib
import hashlib
import uuid
from collections.abc import Sequence

import numpy as np

from mtpgo_core.schema import KeyArray

_WORD = 0xFFFFFFFF


def keys_from_integers(ids: Sequence[int]) -> KeyArray:
    """Return [n, 4] keys of non-negative integers below 2**128."""
    return np.array(
        [[(i >> shift) & _WORD for shift in (0, 32, 64, 96)] for i in map(int, ids)],
        dtype=np.uint32,
    ).reshape(-1, 4)


def keys_from_uuid_bytes(uuids: np.ndarray) -> KeyArray:
    """Return [n, 4] keys of [n, 16] uint8 UUIDs in network byte order."""
    words = np.ascontiguousarray(uuids, dtype=np.uint8).reshape(-1, 16).view(">u4")
    return words[:, ::-1].astype(np.uint32)


def keys_from_strings(names: Sequence[str]) -> KeyArray:
    """Return [n, 4] keys of arbitrary text identities."""
    digest = b"".join(hashlib.blake2b(s.encode(), digest_size=16).digest() for s in names)
    return keys_from_uuid_bytes(np.frombuffer(digest, dtype=np.uint8))


def key_to_int(key: KeyArray) -> int:
    """Return the 128-bit number of one [4] key."""
    return sum(int(word) << (32 * i) for i, word in enumerate(key))


def keys_from_texts(names: Sequence[str]) -> KeyArray:
    """Return [n, 4] keys of identities given as text.

    A decimal number below 2**128, written as ``str`` does, is that integer, a UUID (hexadecimal,
    with or without hyphens) is that UUID, anything else is hashed.
    """
    keys = [_number_in(name) for name in names]
    hashed = [name for name, number in zip(names, keys, strict=True) if number is None]
    out = keys_from_integers([0 if number is None else number for number in keys])
    if hashed:
        out[[number is None for number in keys]] = keys_from_strings(hashed)
    return out


def first_key(*texts: str) -> KeyArray | None:
    """Return the [4] key of the first text that is not blank, None if all are."""
    for text in texts:
        if text.strip():
            return keys_from_texts([text.strip()])[0]
    return None


def key_to_text(key: KeyArray) -> str:
    """Return one [4] key as text that :func:`keys_from_texts` turns into the same key again.

    A number below 2**64 is written in decimal, any other as a UUID.
    """
    number = key_to_int(key)
    return str(number) if number < 1 << 64 else str(uuid.UUID(int=number))


def key_to_uuid_bytes(key: KeyArray) -> bytes:
    """Return the sixteen bytes of one [4] key in network byte order."""
    return key_to_int(key).to_bytes(16, "big")


def _number_in(name: str) -> int | None:
    if name.isascii() and name.isdigit() and len(name) <= 39 and str(int(name)) == name:
        number = int(name)
        return number if number < 1 << 128 else None
    if len(name) in (32, 36):
        with contextlib.suppress(ValueError):
            return uuid.UUID(name).int
    return None
