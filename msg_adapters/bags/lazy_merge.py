# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Merges streams of messages in time; a stream is opened when its time has come."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TimedStream:
    """Messages that ascend in time.

    Attributes:
        start_ns: earliest time of the first (ns).
        items: tuples that begin with the time (ns).
    """

    start_ns: int
    items: Iterator[Any]


def merge_in_time(streams: Iterable[TimedStream]) -> Iterator[Any]:
    """Yield the items of all streams, ascending in time; those of one time by stream.

    No item of a stream is asked for before the streams have come to its ``start_ns``, so that of
    many files or chunks only those are in memory that overlap.
    """
    heap: list[tuple[int, int, Any, Iterator[Any]]] = [
        (stream.start_ns, number, None, stream.items) for number, stream in enumerate(streams)
    ]
    heapq.heapify(heap)
    while heap:
        _, number, item, items = heap[0]
        if item is not None:
            yield item
        following = next(items, None)
        if following is None:
            heapq.heappop(heap)
        else:
            heapq.heapreplace(heap, (following[0], number, following, items))
