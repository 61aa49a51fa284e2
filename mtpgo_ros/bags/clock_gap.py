# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Gaps of days in a bag, which are not played: a clock was set while it was recorded.

A computer without a battery starts in 1970 until it is told the time, and with simulated time the
first messages may come before the clock.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from msg_adapters.bags.bag_loss import counted
from msg_adapters.bags.bag_reader import BagReader, BagTopic

GAP_S = 86_400.0
"""A longer gap is left out (s); chosen: too long to wait for; observed gaps last years."""

_LOOKED_AT = 100_000
"""Most messages in which a gap is looked for; chosen: some minutes of a vehicle's bag."""

_YEAR_S = 365.25 * 86_400.0
"""Mean year (s)."""


@dataclass(frozen=True)
class PlayedPart:
    """The part of a bag that is played.

    Attributes:
        start_ns: log time of its first message (ns).
        end_ns: log time of its last message (ns).
        sentences: what is left out, one for each gap.
    """

    start_ns: int
    end_ns: int
    sentences: tuple[str, ...] = ()


def played_part(bag: BagReader, topics: Sequence[BagTopic]) -> PlayedPart:
    """Return the part of a bag that has no gap of days near its start.

    Of the parts before and after a gap, the one with more messages is played.

    Raises:
        RecordingError: the bag is damaged.
    """
    part = PlayedPart(bag.start_ns, bag.end_ns)
    left = sum(topic.count for topic in topics)
    # Only a bag that lasts longer than a gap can have one: others are not read for this.
    while part.end_ns - part.start_ns > GAP_S * 1e9:
        before_ns = part.start_ns
        stored = bag.raw_messages(topics, part.start_ns, part.end_ns + 1)
        for number, (_, time_ns, _) in enumerate(itertools.islice(stored, _LOOKED_AT)):
            if number and time_ns - before_ns > GAP_S * 1e9:
                break
            before_ns = time_ns
        else:
            return part
        gap = _duration((time_ns - before_ns) * 1e-9)
        sentences = part.sentences
        if 2 * number > left:
            sentences += (
                f"{counted(left - number)} after a gap of {gap} left out, as with a wrong time",
            )
            return PlayedPart(part.start_ns, before_ns, sentences)
        sentences += (
            f"{counted(number)} before a gap of {gap} left out, as recorded before the clock was"
            " set",
        )
        left -= number
        part = PlayedPart(time_ns, part.end_ns, sentences)
    return part


def _duration(seconds: float) -> str:
    if seconds >= _YEAR_S:
        return f"{seconds / _YEAR_S:.1f} years"
    return f"{seconds / 86_400.0:.1f} days"
