# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Streams are merged in time and opened when their time has come."""

from msg_adapters.bags.lazy_merge import TimedStream, merge_in_time


def stream(opened, name, *times):
    def items():
        opened.append(name)
        for time_ns in times:
            yield time_ns, name

    return TimedStream(times[0] if times else 0, items())


def test_the_items_ascend_and_equal_times_keep_the_order_of_the_streams():
    opened = []
    streams = [stream(opened, *s) for s in (("a", 1, 4, 4), ("b", 2, 4, 6), ("c", 5), ("d",))]
    merged = merge_in_time(streams)
    assert next(merged) == (1, "a")
    assert "c" not in opened
    assert list(merged) == [(2, "b"), (4, "a"), (4, "a"), (4, "b"), (5, "c"), (6, "b")]
