# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The hash of the files that are read together."""

import hashlib

import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.reading_unit import Unit


def unit(*files):
    return Unit("01", "ind", files, lambda: iter(()))


def test_the_hash_covers_all_files_in_their_order(tmp_path):
    (tmp_path / "a").write_bytes(b"one")
    (tmp_path / "b").write_bytes(b"two")
    expected = hashlib.sha256(b"onetwo").hexdigest()
    assert unit(tmp_path / "a", tmp_path / "b").sha256 == expected
    assert unit(tmp_path / "b", tmp_path / "a").sha256 != expected


def test_the_files_are_hashed_once(tmp_path):
    (tmp_path / "a").write_bytes(b"one")
    one = unit(tmp_path / "a")
    before = one.sha256
    (tmp_path / "a").unlink()
    assert one.sha256 == before


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    sentence = f"{tmp_path}/missing cannot be read: No such file or directory"
    with pytest.raises(RecordingError) as caught:
        _ = unit(tmp_path / "missing").sha256
    assert str(caught.value) == sentence
