# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CDR bytes written by hand."""

import numpy as np
import pytest

from msg_adapters.wire.cdr import CdrWriter, write_header


def test_alignment_by_hand():
    writer = CdrWriter()
    writer.pack(1, "B", 1)
    writer.text("ab")
    writer.doubles(np.array([1.0]))
    writer.block(1, b"z")
    writer.pack(2, "H", 5)
    assert bytes(writer)[4:] == writer.content
    assert bytes(writer) == (
        b"\x00\x01\x00\x00"
        b"\x01\x00\x00\x00"
        b"\x03\x00\x00\x00ab\x00\x00"
        b"\x00\x00\x00\x00"
        b"\x00\x00\x00\x00\x00\x00\xf0\x3f"
        b"z\x00\x05\x00"
    )


def test_a_text_is_counted_in_bytes_with_its_terminating_zero():
    writer = CdrWriter()
    writer.text("ß")
    assert writer.content == b"\x03\x00\x00\x00\xc3\x9f\x00"


def test_an_empty_block_of_doubles_is_not_aligned():
    """CDR aligns values, and there are none."""
    writer = CdrWriter()
    writer.pack(1, "B", 1)
    writer.doubles(np.empty((0, 3)))
    assert writer.content == b"\x01"


def test_doubles_are_written_row_by_row_whatever_their_layout_in_memory():
    columns = np.array([[1.0, 2.0], [3.0, 4.0]])
    rows, turned = CdrWriter(), CdrWriter()
    rows.doubles(np.ascontiguousarray(columns.T))
    turned.doubles(columns.T)
    assert turned.content == rows.content == np.array([1.0, 3.0, 2.0, 4.0]).tobytes()


@pytest.mark.parametrize(
    ("stamp_ns", "seconds", "nanoseconds"),
    [(1_500_000_000, 1, 500_000_000), (0, 0, 0), (-1, -1, 999_999_999)],
)
def test_a_header_by_hand(stamp_ns, seconds, nanoseconds):
    """The nanoseconds are unsigned, so a stamp before 1970 rounds down to whole seconds."""
    writer = CdrWriter()
    write_header(writer, stamp_ns, "m")
    octets = seconds.to_bytes(4, "little", signed=True) + nanoseconds.to_bytes(4, "little")
    assert writer.content == octets + b"\x02\x00\x00\x00m\x00"
