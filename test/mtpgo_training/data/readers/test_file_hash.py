# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The hash over several files."""

import hashlib

from mtpgo_training.data.readers.file_hash import sha256_of


def test_the_hash_is_that_of_the_joined_contents(tmp_path):
    paths = [tmp_path / "a", tmp_path / "b"]
    paths[0].write_text("one")
    paths[1].write_text("two")
    assert sha256_of(paths) == hashlib.sha256(b"onetwo").hexdigest()
    assert sha256_of(paths[::-1]) == hashlib.sha256(b"twoone").hexdigest()
