# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import (
    new_folder,
    only_writer,
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
        assert list(path.iterdir()) == []
    assert [p.name for p in path.iterdir()] == ["a"]
    (tmp_path / "b").mkdir()
    assert path.stat().st_mode == (tmp_path / "b").stat().st_mode
    refused = pytest.raises(
        ConfigurationError, match=r"run cannot be written: Directory not empty"
    )
    with refused, new_folder(path) as temporary:
        write_text(temporary / "b", "x")
    assert [p.name for p in path.parent.iterdir()] == ["run"]


def test_a_folder_has_one_writer_at_a_time(tmp_path):
    refused = pytest.raises(ConfigurationError, match="is being written by another process")
    with only_writer(tmp_path), refused, only_writer(tmp_path):
        pass
    with only_writer(tmp_path):
        assert list(tmp_path.iterdir()) == []
