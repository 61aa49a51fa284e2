# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether road users have a history: without one, a prediction knows little but the velocity."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import HistoryWindow

SHORT_S = 0.5
"""A road user with a shorter past up to now has none (s); chosen: as long as a track is carried on
after its last observation."""

_FORGET = 0.95
"""Share of the counts that is kept from one look to the next: twenty looks count; chosen."""

_ENOUGH_LOOKS, _ENOUGH = 8.0, 20.0
"""Looks (the first ten), and road users counted once for each look, from which on a verdict is
given; chosen: at the start all road users are new."""

_LEAST_SHARE = 0.6
"""Share of them without a past from which on the source is at fault; chosen: no sensor
sees most of the road users for the first time again and again, every half second."""

_INTERVAL_SHARE = 0.2
"""Weight of the last interval in the usual one; chosen."""


class KnownPast:
    """Counts road users without a history; call :meth:`look` with one window a second."""

    def __init__(self) -> None:
        self._looks = self._users = 0.0
        self._short = 0.0  # sum of the shares without a history
        self._interval_s = 0.0
        self._newest_ns: int | None = None

    def observed(self, stamp_ns: int) -> None:
        """Note the stamp (ns) of a message that has objects."""
        if self._newest_ns is not None and stamp_ns > self._newest_ns:
            step_s = (stamp_ns - self._newest_ns) * 1e-9
            share = _INTERVAL_SHARE if self._interval_s else 1.0
            self._interval_s += share * (step_s - self._interval_s)
        self._newest_ns = stamp_ns

    def look(self, window: HistoryWindow, dt_s: float) -> None:
        """Count the road users that are present at the window's time.

        Args:
            window: of the history.
            dt_s: time between its samples (s).
        """
        valid = window.valid[window.valid[:, -1]]
        if not len(valid):
            return
        missing = ~valid[:, ::-1]  # from now backwards
        known = np.where(missing.any(axis=1), missing.argmax(axis=1), valid.shape[1])
        self._looks = _FORGET * self._looks + 1.0
        self._users = _FORGET * self._users + len(valid)
        self._short = _FORGET * self._short + float(((known - 1) * dt_s <= SHORT_S).mean())

    def problem(self, bridged_s: float) -> str:
        """Return why most road users have no history; empty if they have, or too few were seen.

        Args:
            bridged_s: longest time between two observations that the history bridges (s).
        """
        if self._looks < _ENOUGH_LOOKS or self._users < _ENOUGH:
            return ""
        share = self._short / self._looks
        if share < _LEAST_SHARE:
            return ""
        which = f"{100 * share:.0f} % of the road users have no past"
        if self._interval_s > bridged_s:
            expected = f"; expected at least {1.0 / bridged_s:.2g} Hz" if bridged_s else ""
            return (
                f"{which}: the objects come every {self._interval_s:.2g} s, and the history"
                f" bridges {bridged_s:g} s{expected}"
            )
        return (
            f"{which}: their identities do not last; expected those of a tracker, the same from"
            " message to message"
        )
