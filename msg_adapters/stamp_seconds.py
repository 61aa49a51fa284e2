# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps in another unit: parts of seconds that are no nanoseconds, stamps that hardly advance."""

from __future__ import annotations

_S_NS = 1_000_000_000

_LATEST_NS = 1_000_000
"""A second has a million microseconds: as nanoseconds they end here."""

_FEWEST_STEPS, _FEWEST_SECONDS = 10, 3
"""Fewer steps and seconds do not tell what unit the parts of seconds are in; chosen."""

_SLOWEST = 0.01
"""Stamps that advance within their seconds slower than the time at which they were recorded by
more than this factor are in another unit; chosen above the factor of a thousand."""

SLOWEST_PACE = 0.01
"""Stamps that advance slower than the time at which their messages come by more than this factor
seem to be in another unit; chosen below any simulation, and above milliseconds for seconds."""

_PACE_NS = 3 * _S_NS
"""Time over which the pace is measured (ns); chosen: longer than a tracker hesitates."""


class StampSeconds:
    """Follows how the stamps of messages advance within their seconds.

    The readers of bags follow a whole topic, the node what came since the last stamp outside of
    the first millisecond of a second.
    """

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None
        self._steps = self._steps_within = 0
        self._stamped_ns = self._logged_ns = 0
        self._latest_ns = 0

    def add(self, stamp_ns: int, received_ns: int) -> None:
        """Add the stamp of a message and its log time (ns)."""
        self._latest_ns = max(self._latest_ns, stamp_ns % _S_NS)
        if self._before is not None:
            before_ns, logged_ns = self._before
            self._steps += 1
            if before_ns // _S_NS == stamp_ns // _S_NS:
                self._steps_within += 1
                self._stamped_ns += stamp_ns - before_ns
                self._logged_ns += received_ns - logged_ns
        self._before = stamp_ns, received_ns

    @property
    def are_in_first_millisecond(self) -> bool:
        """Whether all stamps so far are in the first millisecond of a second."""
        return self._latest_ns < _LATEST_NS

    @property
    def are_of_another_unit(self) -> bool:
        """Whether the parts of seconds are not in nanoseconds: all are in the first millisecond.

        Three messages in a second tell it from sensors that measure at full seconds.
        """
        return (
            self._steps >= _FEWEST_STEPS
            and self._steps - self._steps_within >= _FEWEST_SECONDS - 1
            and 3 * self._steps_within >= 2 * self._steps
            and self.are_in_first_millisecond
            and 0 < self._stamped_ns < _SLOWEST * self._logged_ns
        )


class StampPace:
    """Follows how fast stamps advance, as a stream is received.

    Attributes:
        is_slow: they advanced less than :data:`SLOWEST_PACE` times as fast as the clock, in ten
            messages or more over the last three seconds in which this was measured.
    """

    def __init__(self) -> None:
        self.is_slow = False
        self._first: tuple[int, int] | None = None
        self._messages = 0

    def add(self, stamp_ns: int, clock_ns: int) -> None:
        """Add the stamp of a message and the time of its receipt (ns), 0 where it is not known."""
        if clock_ns == 0:
            return
        if self._first is None or stamp_ns < self._first[0] or clock_ns < self._first[1]:
            self._first, self._messages = (stamp_ns, clock_ns), 0
        self._messages += 1
        passed_ns = clock_ns - self._first[1]
        if passed_ns >= _PACE_NS:
            advanced_ns = stamp_ns - self._first[0]
            few = self._messages < _FEWEST_STEPS
            self.is_slow = not few and advanced_ns < SLOWEST_PACE * passed_ns
            self._first, self._messages = (stamp_ns, clock_ns), 0
