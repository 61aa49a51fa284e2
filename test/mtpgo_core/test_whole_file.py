# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A file is written completely or not at all."""

import pytest

from mtpgo_core.whole_file import whole_file


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
