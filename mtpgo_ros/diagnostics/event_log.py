# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts and logs everything that does not go as it should. No ROS in here.

Every odd message, late cycle and failure takes this one route: a counter, which the diagnostics
show, and a log line with the reason, at most one per kind in a few seconds. A line says how many
occurrences were not logged since the last one of its kind, and the last of them are reported, too,
so that the numbers in the log add up to the counters.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mtpgo_core.history.odd_input import ODD_INPUT

RECENT_S = 2.0
"""How long an event keeps its status at WARN (s); chosen so that two reports show it."""

LONGEST_TEXT = 4000
"""Longest log line, and longest text in the diagnostics (characters); chosen: longer than any
sentence of the node's own. Messages bring names of any length."""

REPEAT_S = 5.0
"""Shortest time between two log lines of one kind (s); chosen."""

BAD_TIMING = {
    "deadline_misses": "deadlines missed",
    "over_budget": "cycles over budget, answered by constant velocity",
    "cycles_skipped": "cycles skipped for a newer state",
    "cycles_failed": "cycles without a prediction",
}
"""Counters of late, skipped and failed cycles and their descriptions."""

BAD_MODEL = {
    "model_failures": "failures of the model",
    "not_published": "agents left out because their prediction was not finite",
    "non_finite_output": "agents with a model output that was not finite",
}
"""Counters of the model's failures and their descriptions."""

_DESCRIPTIONS = {**ODD_INPUT, **BAD_TIMING, **BAD_MODEL}


class Logger(Protocol):
    """What is needed of a logger; rclpy's has it."""

    def warning(self, message: str) -> object:
        """Log a warning."""

    def error(self, message: str) -> object:
        """Log an error."""


@dataclass
class _LogLine:
    """The lines of one kind.

    Attributes:
        logged_s: time of the last one that was logged (s).
        swallowed: occurrences since then that were not logged.
        text: last line that was not logged.
        is_error: whether that is an error.
    """

    logged_s: float = -np.inf
    swallowed: int = 0
    text: str = ""
    is_error: bool = False


class EventLog:
    """Counters with the time of their last increment, and throttled log lines; thread-safe.

    Args:
        logger: takes the log lines; without one nothing is logged.
        clock: monotonic time (s).
    """

    def __init__(
        self, logger: Logger | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._logger = logger
        self._clock = clock
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._last_counted_s: dict[str, float] = {}
        self._details: dict[str, str] = {}
        self._lines: dict[str, _LogLine] = {}

    def count(
        self,
        name: str,
        number: int = 1,
        reason: str = "",
        *,
        detail: str = "",
        is_error: bool = False,
    ) -> None:
        """Add to a counter and log the reason; zero changes nothing.

        Args:
            name: of the counter.
            number: how many to add.
            reason: log line; without it the counter's description is logged, if it has one.
            detail: what is known of this case; it follows the description.
            is_error: log an error instead of a warning.
        """
        if not number:
            return
        with self._lock:
            self._counts[name] += number
            self._last_counted_s[name] = self._clock()
            self._details[name] = detail
        if reason:
            self.log(name, reason, number=number, is_error=is_error)
        elif name in _DESCRIPTIONS:
            line = _with_detail(_DESCRIPTIONS[name], detail)
            self.log(name, line, number=number, is_error=is_error)

    def failure(self, what: str, error: Exception, counter: str = "") -> None:
        """Log an exception that the node survived, and count it.

        Args:
            what: what failed, and with which consequence.
            error: the exception.
            counter: name of the counter, empty for none.
        """
        text = " ".join(str(error).split()) or "no message"
        line = f"{what}: {type(error).__name__}: {text}"
        if counter:
            self.count(counter, reason=line, detail=text)
        else:
            self.log(what, line)

    def log(self, kind: str, line: str, *, number: int = 1, is_error: bool = False) -> None:
        """Log a line unless one of its kind was logged within :data:`REPEAT_S`.

        Args:
            kind: lines of one kind share the limit; the name of a counter, or any text.
            line: the line; the number follows a counter's own description.
            number: how many occurrences it stands for.
            is_error: log an error instead of a warning.
        """
        now_s = self._clock()
        with self._lock:
            known = self._lines.setdefault(kind, _LogLine())
            if now_s - known.logged_s < REPEAT_S:
                known.swallowed += number
                known.text, known.is_error = line, is_error
                return
            swallowed, known.swallowed, known.logged_s = known.swallowed, 0, now_s
        self._write(_with_number(kind, line, number, swallowed), is_error=is_error)

    def flush(self) -> None:
        """Log how often lines were swallowed after the last one of their kind; call regularly."""
        now_s, due = self._clock(), []
        with self._lock:
            for kind, known in self._lines.items():
                if known.swallowed and now_s - known.logged_s >= REPEAT_S:
                    line = _with_number(kind, known.text, 0, known.swallowed)
                    due.append((line, known.is_error))
                    known.swallowed, known.logged_s = 0, now_s
        for line, is_error in due:
            self._write(line, is_error=is_error)

    def _write(self, line: str, *, is_error: bool) -> None:
        if self._logger is None:
            return
        line = shortened(line)
        if is_error:
            self._logger.error(line)
        else:
            self._logger.warning(line)

    def reset(self) -> None:
        """Set all counters to zero."""
        with self._lock:
            self._counts.clear()
            self._last_counted_s.clear()
            self._details.clear()

    def counts(self) -> Mapping[str, int]:
        """Return all counters that are not zero."""
        with self._lock:
            return dict(self._counts)

    def recent(self, descriptions: Mapping[str, str]) -> list[str]:
        """Return the descriptions of the counters that increased within :data:`RECENT_S`.

        Args:
            descriptions: from counter to description.

        Returns:
            Descriptions, each with the detail of its last case and the counter's total.
        """
        with self._lock:
            since_s = self._clock() - RECENT_S
            return [
                _with_detail(description, self._details[name], f"{self._counts[name]} in all")
                for name, description in descriptions.items()
                if self._last_counted_s.get(name, -np.inf) >= since_s
            ]


def shortened(text: str) -> str:
    """Return a text, cut off after :data:`LONGEST_TEXT` characters."""
    if len(text) <= LONGEST_TEXT:
        return text
    return f"{text[:LONGEST_TEXT]}... ({len(text)} characters)"


def _with_detail(description: str, *details: str) -> str:
    """Return a description with the details that are not empty behind it, in brackets."""
    known = "; ".join(filter(None, details))
    return f"{description} ({known})" if known else description


def _with_number(kind: str, line: str, number: int, swallowed: int) -> str:
    """Return a line with the number of its occurrences since the last line of its kind."""
    if kind in _DESCRIPTIONS and line.startswith(_DESCRIPTIONS[kind]):
        return f"{line}: {number + swallowed}"
    return f"{line} ({swallowed} more since)" if swallowed else line
