# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plausibility of a stream of tracked objects as a whole: units, frames and identities.

Each object may be valid and all of them wrong: in km/h, in the frame of a sensor, or with
identities that change. Problems are reported, not corrected: the source has to be fixed.
"""

from __future__ import annotations

from mtpgo_core.history.checks.box_fit import BoxFit
from mtpgo_core.history.checks.known_past import KnownPast
from mtpgo_core.history.checks.movement_fit import SPAN_S, MovementFit
from mtpgo_core.history.checks.position_spread import PositionSpread
from mtpgo_core.history.checks.stamp_age import StampAge
from mtpgo_core.schema import HistoryWindow
from mtpgo_core.task.task_description import HistoryConfig

_LOOK_NS = round(SPAN_S * 1e9)
"""Time between two looks (ns): each movement is compared once."""


class StreamChecks:
    """Runs all checks on the stream of a history, once per second of stream time.

    Args:
        config: of the history.

    Attributes:
        doubts: sentences on what is implausible, by kind.
    """

    def __init__(self, config: HistoryConfig) -> None:
        self._config = config
        self.doubts: dict[str, str] = {}
        self._looked_ns = 0
        self._age, self._past, self._spread = StampAge(), KnownPast(), PositionSpread()
        self._movement, self._boxes = MovementFit(), BoxFit()

    def observed(self, stamp_ns: int, now_ns: int) -> None:
        """Note a message with objects that entered the history.

        Args:
            stamp_ns: its stamp (ns).
            now_ns: time of its receipt by the node's clock (ns), 0 while that shows none.
        """
        self._past.observed(stamp_ns)
        self._age.add(stamp_ns, now_ns)

    def due(self, stamp_ns: int) -> bool:
        """Return whether a time (ns) is a second after the last look, or before it."""
        return abs(stamp_ns - self._looked_ns) >= _LOOK_NS

    def look(self, window: HistoryWindow) -> bool:
        """Look at a window of the history; return false less than a second after the last look.

        Args:
            window: of the time of an observation. In one of a later time, as where a delay is
                compensated, no road user is there at the samples between the two.
        """
        if not self.due(window.stamp_ns):
            return False
        self._looked_ns = window.stamp_ns
        self._movement.look(window, self._config.dt_s)
        self._past.look(window, self._config.dt_s)
        self._spread.look(window)
        self._boxes.look(window)
        found = {
            "old": self._age.problem,
            "positions": self._spread.problem,
            "past": self._past.problem(self._config.max_gap_s),
            "velocities": self._movement.velocity_problem,
            "headings": self._movement.heading_problem,
            "sizes": self._boxes.size_problem,
            "doubles": self._boxes.double_problem,
        }
        self.doubts = {kind: sentence for kind, sentence in found.items() if sentence}
        return True

    def twist_frame_changed(self) -> None:
        """Forget the movements: velocities are in another frame from now on."""
        self._movement = MovementFit()
        self.doubts = {
            kind: sentence
            for kind, sentence in self.doubts.items()
            if kind not in ("velocities", "headings")
        }
