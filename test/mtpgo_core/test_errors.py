# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sentences for bad input stay sentences, whatever the names in them."""

import pytest

from mtpgo_core.errors import listed


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([], "none"),
        (["x", "y"], "x, y"),
        (["x", "id\n3", ""], "x, 'id\\n3', ''"),
        (["x" * 300], "x" * 256 + "..."),
        ([str(k) for k in range(103)], ", ".join(str(k) for k in range(100)) + " and 3 more"),
    ],
)
def test_foreign_names_are_part_of_one_line(names, text):
    assert listed(names) == text


def test_limits_can_be_smaller():
    assert listed(["abc", "def", "g"], most=2, longest=2) == "ab..., de... and 1 more"
