# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether velocities and headings match the movement: in another frame or unit they do not."""

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
"""Largest difference of a correct heading from the direction of movement (rad); chosen."""

_FORGET = 0.98
"""Factor by which the counts decay from one check to the next: a memory of fifty; chosen."""

_ENOUGH = 40.0
"""Fewest comparisons for a verdict; chosen."""

_LEAST_SHARE = 0.35
"""Share of wrong comparisons from which the source is taken to be wrong, not single road users.
Chosen: real and simulated trackers have at most 0.05 over a recording, and once 0.29 in the first
forty; with velocities in the object frame and traffic along the x axis in both directions it is
one half."""

_ONE_WAY = 0.8
"""Length of the mean unit vector from which the directions count as equal; chosen."""

_NOTHING = 0.05
"""A velocity below this share of the movement counts as not filled in; chosen."""


class MovementFit:
    """Compares velocities and headings with movements; call :meth:`look` once a second."""

    def __init__(self) -> None:
        self._velocities, self._headings = _Comparisons(), _Comparisons()

    def look(self, window: HistoryWindow, dt_s: float) -> None:
        """Compare the movement of a window's road users over the last second.

        Args:
            window: of the history. Velocities that it estimated from positions always match.
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
        """Compare movements over about a second; the counts of earlier ones decay.

        Args:
            moved: [n, 2] mean velocity from the positions (m/s).
            velocity: [n, 2] mean of the given velocities over that time (m/s), NaN where unknown.
            yaw: [n] given heading in the middle of that time (rad), NaN where unknown.
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
        """Sentence on velocities that do not match; empty if they do, or too few were seen."""
        found = self._velocities.problem("the velocities of the road users")
        return found and f"{found}; expected: over ground, in m/s, in the frame of the objects"

    @property
    def heading_problem(self) -> str:
        """Sentence on headings that do not match; empty if they do, or too few were seen."""
        found = self._headings.problem("the headings of the road users")
        return found and f"{found}; expected: radians, counter-clockwise from the x axis"


class _Comparisons:
    """Counts comparisons of one quantity, and the mean difference of the wrong ones."""

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
        """Add n comparisons of a quantity with the movement.

        Args:
            usable: [n] the comparison counts; other entries may be NaN.
            wrong: [n] the two do not match.
            turn: [n] angle from the movement to the quantity (rad).
            ratio: [n] length of the quantity over that of the movement.
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
        """Return the mean difference of the wrong comparisons, as part of a sentence."""
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
