# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps whose parts of a second are in microseconds or milliseconds, and not in nanoseconds."""

from __future__ import annotations

_S_NS = 1_000_000_000

_LATEST_NS = 1_000_000
"""A second has a million microseconds: as nanoseconds they end here."""

_FEWEST_STEPS, _FEWEST_SECONDS = 10, 3
"""Fewer steps and seconds do not tell what unit the parts of seconds are in; chosen."""

_SLOWEST = 0.01
"""Stamps that advance within their seconds slower than the time at which they were recorded by
more than this factor are in another unit; chosen above the factor of a thousand."""


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
