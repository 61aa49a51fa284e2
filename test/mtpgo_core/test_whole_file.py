# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A file is written completely or not at all, and read only if it has an end."""

import os

import pytest

from mtpgo_core.whole_file import read_regular, user_path, whole_file


def test_the_file_is_replaced_at_the_end_with_its_permissions(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    with whole_file(path, 0o640) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(path, 0o644) as temporary:
        temporary.write_text(str(len("half") / 0))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_symbolic_link_stays_and_the_file_behind_it_is_replaced(tmp_path):
    (tmp_path / "store").mkdir()
    link, target = tmp_path / "link", tmp_path / "store" / "a"
    link.symlink_to(target)
    for text in ("first", "second"):  # there is no target at first
        with whole_file(link, 0o644) as temporary:
            temporary.write_text(text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert list(target.parent.iterdir()) == [target]


def test_a_device_a_pipe_and_a_folder_are_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/null", tmp_path / "pipe", tmp_path):
        before = os.stat(path).st_mode
        with pytest.raises(OSError, match=r"no regular file|Is a directory"):
            whole_file(path, 0o644).__enter__()
        assert os.stat(path).st_mode == before


def test_only_a_file_with_an_end_is_read(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_regular(path, 5) == b"12345"
    assert read_regular(path, 2) == b"123"  # one more shows that there is more
    os.mkfifo(tmp_path / "pipe")  # without a writer: opening it would wait for ever
    for none in (tmp_path / "pipe", "/dev/zero", tmp_path, tmp_path / "b", tmp_path / "a\0b"):
        with pytest.raises(OSError, match=r".") as caught:
            read_regular(none, 5)
        assert caught.value.strerror


def test_a_home_folder_is_found_and_an_unknown_one_left_as_it_is(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert user_path("~/a/b.pt") == tmp_path / "a" / "b.pt"
    assert str(user_path("~no_such_user/b.pt")) == "~no_such_user/b.pt"
    assert str(user_path("a~b")) == "a~b"
