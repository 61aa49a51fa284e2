# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Archives beyond the limits, and files that are none."""

import io
import os
import struct
import zipfile

import pytest

from mtpgo_core.errors import ModelFileError
from mtpgo_core.task.checked_archive import ArchiveLimits, check_archive, read_archive

SMALL = ArchiveLimits(file_mb=1, unpacked_mb=1, deflated_mb=1, records=10)


def packed(records, method=zipfile.ZIP_STORED):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in records:
            archive.writestr(name, content)
    return buffer.getvalue()


def refusal(path, data=None, limits=SMALL):
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(ModelFileError) as caught:
        read_archive(path, ModelFileError, "model", limits)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_records_come_back_without_their_folder(tmp_path):
    path = tmp_path / "good.zip"
    path.write_bytes(packed([("a/x", b"1"), ("a/b/y", b"22")], zipfile.ZIP_DEFLATED))
    archive = read_archive(path, ModelFileError, "model")
    assert archive.records() == {"x": b"1", "b/y": b"22"}
    assert archive.record("b/y") == b"22"
    assert len(archive.sha256) == 64


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "File is not a zip file"),
        (packed([("a/x", b"1"), ("b/y", b"1")]), "records in several folders"),
        (packed([("a/x", b"1"), ("a/X", b"1")]), "two records of the same name"),
        (packed([("a/x", bytes(3 << 20))], zipfile.ZIP_DEFLATED), "unpacks to 3 MB, expected at"),
        (packed([(f"a/{k}", b"") for k in range(11)]), "has 11 records, expected at most 10"),
        (packed([("a/x", b"1")], zipfile.ZIP_LZMA), "compression method 14"),
        (bytes(2 << 20), "has 2 MB, expected a model file of at most 1 MB"),
    ],
    ids=["empty", "folders", "case", "bomb", "records", "method", "size"],
)
def test_a_limit_is_named(tmp_path, data, words):
    assert words in refusal(tmp_path / "bad.zip", data)


def test_records_that_overlap(tmp_path):
    data = bytearray(packed([("a/x", bytes(1000)), ("a/y", bytes(1000))]))
    directory = data.index(b"PK\x01\x02")
    for at in (directory, data.index(b"PK\x01\x02", directory + 1)):
        data[at + 20 : at + 28] = struct.pack("<II", 1500, 1500)
    assert "has records that overlap" in refusal(tmp_path / "bad.zip", bytes(data))


def test_a_wrong_checksum_and_a_password(tmp_path):
    data = bytearray(packed([("a/x", b"weights")]))
    data[data.index(b"weights")] ^= 1
    assert "Bad CRC-32" in refusal(tmp_path / "bad.zip", bytes(data))
    data = bytearray(packed([("a/x", b"weights")]))
    data[data.index(b"PK\x01\x02") + 8] |= 1
    assert "is encrypted" in refusal(tmp_path / "bad.zip", bytes(data))


def test_what_is_no_regular_file(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert refusal(pipe) == "is no regular file, expected a model file"
    assert "is a directory" in refusal(tmp_path)
    assert refusal(tmp_path / "none") == "does not exist"
    assert "cannot be read" in refusal(tmp_path / ("x" * 300))


def test_bytes_are_checked_as_a_file_is(tmp_path):
    archive = check_archive(tmp_path, packed([("a/x", b"1")]), ModelFileError, "model")
    assert archive.names == {"x": "a/x"}
