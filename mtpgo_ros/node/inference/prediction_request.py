# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One request for a prediction, and the protocol by which it is answered exactly once."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from mtpgo_core.schema import HistoryWindow


@dataclass(eq=False)
class PredictionRequest:
    """A history window that is to be predicted in time.

    Claim protocol: the inference worker and the deadline watchdog may both want to answer a
    request. Each calls :meth:`claim` first, and only the first caller gets true: it answers the
    request, or drops it on purpose. The other one discards its result. A claim is never given
    back.

    Attributes:
        window: the model's input.
        stamp_ns: time of the observation (ns); the window's is later under delay compensation.
        received_ns: receipt of the observation (ns of the monotonic clock).
        budget_ns: time after ``received_ns`` from which on the fallback answers (ns).
        deadline_ns: time after ``received_ns`` from which on an answer is late (ns).
        over_budget: the fallback answers because the model was not ready.
        scored: set once earlier predictions are scored by the observation, so that what was
            learned from it is served in each run.
        submitted_ns: when it was submitted, 0 before (ns of the monotonic clock).
        begun_ns: when the model began with it, 0 before (ns of the monotonic clock).
        predicted_ns: when the model's answer was there, 0 before (ns of the monotonic clock).
        computed_ns: processor time of the worker's thread in the model (ns).
    """

    window: HistoryWindow
    stamp_ns: int
    received_ns: int
    budget_ns: int
    deadline_ns: int
    over_budget: bool = False
    scored: threading.Event = field(default_factory=threading.Event, repr=False)
    submitted_ns: int = 0
    begun_ns: int = 0
    predicted_ns: int = 0
    computed_ns: int = 0
    _claim: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @property
    def due_ns(self) -> int:
        """When the fallback answers (ns of the monotonic clock)."""
        return self.received_ns + self.budget_ns

    @property
    def claimed(self) -> bool:
        """Whether the request has been claimed."""
        return self._claim.locked()

    def claim(self) -> bool:
        """Take the right to answer; return true for the first caller only. Any thread."""
        return self._claim.acquire(blocking=False)
