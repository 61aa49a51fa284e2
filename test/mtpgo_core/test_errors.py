# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sentences for bad input stay sentences, whatever the names in them."""

import pytest

from mtpgo_core.errors import found_names


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
    assert found_names(names) == text


def test_limits_can_be_smaller():
    assert found_names([], none="no topic") == "no topic"
    assert found_names(["abc", "def", "g"], most=2, longest=2) == "ab..., de... and 1 more"
