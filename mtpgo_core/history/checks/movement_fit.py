# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether velocities and headings fit the movement: those of another frame or unit do not."""

from __future__ import annotations

import numpy as np

from mtpgo_core.frames import wrap
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow

SPAN_S = 1.0
"""Time over which a movement is compared (s); chosen: noise of positions hardly matters then, and
a road user does not turn far."""

_SLOWEST_MPS = 1.0
"""Neither the movement nor the velocity of a standing road user says anything below this (m/s);
chosen: slower than walking."""

_WRONG_MPS, _WRONG_SHARE = 1.0, 0.5
"""A velocity is wrong if it differs from the movement by more than both, the latter a share of the
larger speed; chosen above the lag of a filter."""

_SLOWEST_HEADING_MPS = 2.0
"""Slower road users may face elsewhere than they go (m/s); chosen: pedestrians do."""

_WRONG_RAD = np.pi / 4
"""A heading is wrong if it differs more from the direction of the movement; chosen."""

_FORGET = 0.98
"""Share of the counts that is kept from one look to the next: fifty looks count; chosen."""

_ENOUGH = 40.0
"""Comparisons from which on a verdict is given; chosen."""

_LEAST_SHARE = 0.35
"""Share of them that are wrong from which on the source is mistaken, not a single road user;
chosen: of those of real and simulated trackers at most 0.05 are over a recording, and once 0.29 of
the first forty; half of them are where velocities are in the frames of objects that go to and fro
along the x axis."""

_ONE_WAY = 0.8
"""Length of the mean of unit vectors from which on their directions agree; chosen."""

_NOTHING = 0.05
"""A velocity below this share of the movement is none; chosen."""


class MovementFit:
    """Compares velocities and headings with movements; to be shown one window a second."""

    def __init__(self) -> None:
        self._velocities, self._headings = _Comparisons(), _Comparisons()

    def look(self, window: HistoryWindow, dt_s: float) -> None:
        """Compare what the road users of a window have done over the last second.

        Args:
            window: of the history. What it had to estimate from positions fits.
            dt_s: time between its samples (s).
        """
        steps = min(round(SPAN_S / dt_s), window.valid.shape[1] - 1)
        if steps < 1:
            return
        there = window.valid[:, -1 - steps :].all(axis=1)
        position = window.position[there, -1 - steps :]
        velocity = window.velocity[there, -1 - steps :]
        mean = (0.5 * (velocity[:, :-1] + velocity[:, 1:])).mean(axis=1)
        moved = (position[:, -1] - position[:, 0]) / (steps * dt_s)
        self.compare(moved, mean, window.yaw[there, -1 - steps // 2])

    def compare(self, moved: Float64Array, velocity: Float64Array, yaw: Float64Array) -> None:
        """Compare movements of about a second; earlier ones count a little less.

        Args:
            moved: [n, 2] velocity by the positions (m/s).
            velocity: [n, 2] as given, the mean over that time (m/s), NaN where unknown.
            yaw: [n] heading in the middle of it (rad), NaN where unknown.
        """
        speed, given = (np.hypot(v[:, 0], v[:, 1]) for v in (moved, velocity))
        course = np.arctan2(moved[:, 1], moved[:, 0])
        both = np.maximum(speed, given)  # NaN where one is
        apart = np.hypot(*(velocity - moved).T)
        self._velocities.add(
            usable=both > _SLOWEST_MPS,
            wrong=(apart > _WRONG_MPS) & (apart > _WRONG_SHARE * both),
            turn=np.arctan2(velocity[:, 1], velocity[:, 0]) - course,
            ratio=given / np.maximum(speed, 1e-3),
        )
        turn = yaw - course
        self._headings.add(
            usable=(speed > _SLOWEST_HEADING_MPS) & np.isfinite(yaw),
            wrong=np.abs(wrap(turn)) > _WRONG_RAD,
            turn=turn,
            ratio=np.ones(len(yaw)),
        )

    @property
    def velocity_problem(self) -> str:
        """How the velocities do not fit the movement, empty if they do or little is known."""
        found = self._velocities.problem("the velocities of the road users")
        return found and f"{found}; expected: over ground, in m/s, in the frame of the objects"

    @property
    def heading_problem(self) -> str:
        """How the headings do not fit the movement, empty if they do or little is known."""
        found = self._headings.problem("the headings of the road users")
        return found and f"{found}; expected: radians, counter-clockwise from the x axis"


class _Comparisons:
    """Counts comparisons of one quantity, and how those that are wrong differ in the mean."""

    def __init__(self) -> None:
        self._count = self._wrong = self._log_ratio = 0.0
        self._direction = 0.0j  # sum of unit vectors

    def add(
        self,
        usable: BoolArray,
        wrong: BoolArray,
        turn: Float64Array,
        ratio: Float64Array,
    ) -> None:
        """Add comparisons [n]; what is not usable may be NaN.

        Args:
            usable: they say something.
            wrong: the two do not fit.
            turn: angle from the movement to what is compared with it (rad).
            ratio: of their lengths.
        """
        wrong = wrong & usable
        log_ratio = np.log(np.maximum(ratio[wrong], 1e-3))
        self._count = _FORGET * self._count + int(usable.sum())
        self._wrong = _FORGET * self._wrong + int(wrong.sum())
        self._log_ratio = _FORGET * self._log_ratio + float(log_ratio.sum())
        self._direction = _FORGET * self._direction + complex(np.exp(1j * turn[wrong]).sum())

    def problem(self, what: str) -> str:
        """Return what is wrong, empty if nothing is."""
        if self._count < _ENOUGH or self._wrong < _LEAST_SHARE * self._count:
            return ""
        share = f"in {100 * self._wrong / self._count:.0f} % of {self._count:.0f} comparisons"
        how = ", ".join(self._differences())
        return f"{what} do not fit their movement {share}" + (f" ({how})" if how else "")

    def _differences(self) -> list[str]:
        """Return how those that are wrong differ in the mean."""
        ratio = float(np.exp(self._log_ratio / self._wrong))
        if ratio < _NOTHING:
            return ["nearly zero"]
        found = []
        if not 0.8 < ratio < 1.25:
            found.append(f"{ratio:.2g} times as large in the mean")
        mean = self._direction / self._wrong
        degrees = float(np.degrees(np.angle(mean)))
        if abs(mean) <= _ONE_WAY:
            found.append("in other directions")
        elif abs(degrees) > 20.0:
            found.append(f"turned by {degrees:.0f} degrees in the mean")
        return found
