# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether all road users are in one place, as with positions in degrees or kilometres."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import HistoryWindow

FEWEST_USERS, SMALLEST_M = 3, 0.3
"""So many road users at a time are not all in a square of this size (m); chosen: pedestrians need
more, and those of a site in degrees or kilometres are. Two may be a single one that is there
twice."""

_ENOUGH_LOOKS = 10
"""Looks in a row from which on a verdict is given; chosen."""


class PositionSpread:
    """Checks how far apart road users are; call :meth:`look` with one window a second."""

    def __init__(self) -> None:
        self._looks = 0  # in a row
        self._low = self._high = np.zeros(2)
        self._users = 0

    def look(self, window: HistoryWindow) -> None:
        """Check the road users that are present at the window's time.

        Args:
            window: of the history.
        """
        position = window.position[window.valid[:, -1], -1]
        if len(position) < FEWEST_USERS:
            return
        low, high = position.min(axis=0), position.max(axis=0)
        if self._looks:
            low, high = np.minimum(low, self._low), np.maximum(high, self._high)
        small = float((high - low).max()) < SMALLEST_M
        self._looks = self._looks + 1 if small else 0
        self._low, self._high, self._users = low, high, len(position)

    @property
    def problem(self) -> str:
        """Sentence saying that all are in one place; empty if not, or too few were seen."""
        if self._looks < _ENOUGH_LOOKS:
            return ""
        return one_place(self._users, float((self._high - self._low).max()))


def one_place(users: int, size_m: float) -> str:
    """Return the sentence on road users that are all in one place.

    Args:
        users: how many there are at a time.
        size_m: size of the square that they are in (m).
    """
    return (
        f"{users} road users at a time are within {size_m:.2g} m; is the unit of the positions"
        " another one, such as degrees or kilometres?"
    )
