# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files."""

import errno
import os
from pathlib import Path

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import (
    new_folder,
    only_writer,
    read_json,
    replacing,
    require_writable,
    write_text,
)


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "sub" / "a.txt"
    write_text(path, "old")
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_text(str(len("half") / 0))
    assert path.read_text() == "old"
    assert [p.name for p in path.parent.iterdir()] == ["a.txt"]


def test_the_file_is_readable_like_any_other(tmp_path):
    write_text(tmp_path / "a", "x")
    (tmp_path / "b").write_text("x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


@pytest.mark.parametrize("check", [require_writable, lambda path: write_text(path, "")])
def test_an_unwritable_path_is_named(tmp_path, check):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match=r"file/below.txt cannot be written"):
        check(tmp_path / "file" / "below.txt")


def test_a_directory_is_not_a_file_to_write(tmp_path):
    with pytest.raises(ConfigurationError, match="is a directory"):
        require_writable(tmp_path)


def test_a_folder_appears_with_all_of_its_files_or_not_at_all(tmp_path):
    path = tmp_path / "sub" / "run"
    with pytest.raises(ZeroDivisionError), new_folder(path) as temporary:
        write_text(temporary / "a", str(1 / 0))
    assert list(path.parent.iterdir()) == []
    path.mkdir()
    with new_folder(path) as temporary:
        write_text(temporary / "a", "x")
        assert not (path / "a").exists()
    assert [p.name for p in path.iterdir()] == ["a"]
    (tmp_path / "b").mkdir()
    assert path.stat().st_mode == (tmp_path / "b").stat().st_mode
    refused = pytest.raises(
        ConfigurationError, match=r"run cannot be written: Directory not empty"
    )
    with refused, new_folder(path) as temporary:
        write_text(temporary / "b", "x")
    assert [p.name for p in path.parent.iterdir()] == ["run"]


def test_the_working_directory_is_filled_and_stays_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with new_folder(Path()) as temporary:
        write_text(temporary / "a", "x")
    write_text(Path("b"), "y")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_a_folder_has_one_writer_at_a_time(tmp_path):
    refused = pytest.raises(ConfigurationError, match="is being written by another process")
    with only_writer(tmp_path), refused, only_writer(tmp_path):
        pass
    with only_writer(tmp_path):
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("write", [replacing, new_folder])
def test_a_full_disk_is_one_sentence_and_the_old_file_stays(tmp_path, write):
    if write is replacing:
        write_text(tmp_path / "a", "old")
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    sentence = pytest.raises(ConfigurationError, match="a cannot be written: No space left on dev")
    with sentence, write(tmp_path / "a"):
        raise full
    assert [path.name for path in tmp_path.iterdir()] == (["a"] if write is replacing else [])
    assert write is new_folder or (tmp_path / "a").read_text() == "old"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "a.json cannot be read: No such file"),
        ("", "a.json is damaged, expected scores: Expecting value"),
        ("[1]", "a.json is damaged, expected scores: it has no 'seed'"),
        ('{"values": 1}', "a.json is damaged, expected scores: it has no 'seed'"),
        ("[" * 100_000, "a.json is damaged, expected scores: "),
    ],
)
def test_a_damaged_json_file_is_named(tmp_path, text, reason):
    if text is not None:
        (tmp_path / "a.json").write_text(text)
    with pytest.raises(ConfigurationError, match=reason):
        read_json(tmp_path / "a.json", "scores", ("seed",))


def test_json_is_read_back(tmp_path):
    write_text(tmp_path / "a.json", '{"seed": 3}')
    assert read_json(tmp_path / "a.json", "scores", ("seed",)) == {"seed": 3}
    write_text(tmp_path / "b.json", "[1]")
    with pytest.raises(ConfigurationError, match="it holds no object"):
        read_json(tmp_path / "b.json", "scores")


def test_a_link_to_itself_is_one_sentence(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with (
        pytest.raises(ConfigurationError, match="loop cannot be written"),
        new_folder(tmp_path / "loop"),
    ):
        pass
