# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One verdict on the node for supervisors: one level, one message, since when.

The verdict is the worst of the diagnostic statuses, and the message has a sentence for each that
is not OK: bad predictions are often the consequence of a wrong input, which is only a warning. It
becomes worse immediately and better only after the worse level has not been seen for a while, so
that a fault that comes and goes is one fault. What a change of the life cycle's state has ended is
forgotten immediately.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_ros.diagnostics.diagnostic_status import make_status

HOLD_S = 3.0
"""How long a level stays after it was last seen (s); chosen: with the two seconds for which an odd
event raises a status, one that comes every few seconds does not flicker."""


@dataclass(frozen=True)
class Verdict:
    """The health of the node.

    Attributes:
        level: OK, WARN or ERROR of diagnostic_msgs/DiagnosticStatus.
        sentence: why; of several statuses the worst first, of equal levels in their order.
        cause: last word of the name of the first of these statuses, empty if all is well.
        state: of the life cycle.
        since: time at which the level began, of the machine's clock.
        for_s: how long ago that was (s).
    """

    level: bytes
    sentence: str
    cause: str
    state: str
    since: datetime
    for_s: float

    def message(self, name: str) -> DiagnosticStatus:
        """Return the message of the node ``name``."""
        values = {
            "state": self.state,
            "cause": self.cause,
            "since": self.since.isoformat(timespec="milliseconds"),
            "for_s": f"{self.for_s:.1f}",
        }
        return make_status(f"{name}: health", self.level, self.sentence, values)


@dataclass
class _Seen:
    """A level of a status: its sentence, and when it was last seen (s)."""

    sentence: str
    seen_s: float


class HealthMonitor:
    """Makes the verdict of the statuses that it is shown.

    Args:
        clock: monotonic time (s).
        wall_clock: the machine's time.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        wall_clock: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self._clock, self._wall_clock = clock, wall_clock
        self._state = ""
        self._held: dict[tuple[str, bytes], _Seen] = {}
        self._level: bytes | None = None
        self._began_s, self._since = clock(), wall_clock()

    def verdict(self, statuses: Sequence[DiagnosticStatus], state: str) -> Verdict:
        """Return the verdict; call it regularly.

        Args:
            statuses: of the node, at present.
            state: of the life cycle.
        """
        now_s, ok = self._clock(), DiagnosticStatus.OK
        if state != self._state:
            self._state = state
            self._held.clear()
        for status in statuses:
            if status.level != ok:
                seen = self._held.setdefault((status.name, status.level), _Seen("", now_s))
                seen.sentence, seen.seen_s = status.message, now_s
        self._held = {k: v for k, v in self._held.items() if now_s - v.seen_s <= HOLD_S}
        worst = dict(sorted(self._held))  # the worst level of each status
        level = max(worst.values(), default=ok)
        # What is over is said only as long as it holds the level.
        names = [s.name for s in statuses if worst.get(s.name) == level or s.level != ok]
        names.sort(key=worst.__getitem__, reverse=True)  # equal levels stay in their order
        if names:
            cause = names[0].split()[-1]
            said = [self._held[name, worst[name]].sentence for name in names]
        else:
            cause = ""
            said = [status.message for status in statuses]
        sentence = "; ".join(dict.fromkeys(said))
        if level != self._level:
            self._level, self._began_s, self._since = level, now_s, self._wall_clock()
        for_s = now_s - self._began_s
        return Verdict(level, sentence, cause, state, self._since, for_s)
