# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How old observations are at their receipt: predictions begin at their stamps."""

from __future__ import annotations

from collections import deque

OLD_S = 0.5
"""Older observations are of a past that planners do not expect (s); chosen: the history is not
carried on farther."""

_RECORDED_S = 86400.0
"""Stamps this far behind the clock (s) are those of a recording that is played; chosen: a day."""

_MESSAGES = 20
"""Messages that are looked at: all of them must be old; chosen: two seconds of most trackers."""


class StampAge:
    """Keeps the age of the last observations."""

    def __init__(self) -> None:
        self._age_s: deque[float] = deque(maxlen=_MESSAGES)

    def add(self, stamp_ns: int, now_ns: int) -> None:
        """Note an observation.

        Args:
            stamp_ns: its stamp (ns).
            now_ns: time of its receipt by the node's clock (ns), 0 while that shows none.
        """
        if now_ns:
            self._age_s.append((now_ns - stamp_ns) * 1e-9)

    @property
    def problem(self) -> str:
        """Sentence saying that the observations are old; empty if not, or too few were seen."""
        if len(self._age_s) < _MESSAGES:
            return ""
        newest_s = min(self._age_s)
        if not OLD_S < newest_s < _RECORDED_S:
            return ""
        return (
            f"the objects are {newest_s:.2g} s old when they come, by their stamps and the node's"
            " clock, and predictions begin then: is the tracker slow, or its clock behind?"
        )
