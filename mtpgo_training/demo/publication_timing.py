# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Was every prediction there, whole and in time? Judged by what was recorded, not by the node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Int64Array = NDArray[np.int64]

STAMP_SLACK_NS = 1_000
"""Stamps closer than this are the same time: bags and messages round differently (ns)."""


@dataclass(frozen=True)
class PublicationTiming:
    """How punctual and how complete the predictions of one recording were.

    Attributes:
        cycles: predictions that the rate asks for.
        published: predictions that came.
        missed: cycles without a prediction.
        late: predictions later than one period after their observation.
        agents_max: most road users in one observation.
        missing_agents: road users observed at a predicted instant but not in its prediction.
        latency_ms: receipt of each prediction after receipt of its observation (ms).
    """

    cycles: int
    published: int
    missed: int
    late: int
    agents_max: int
    missing_agents: int
    latency_ms: NDArray[np.float64]

    @property
    def deadline_misses(self) -> int:
        """Cycles whose prediction was late or never came."""
        return self.missed + self.late


def joined(timings: Sequence[PublicationTiming]) -> PublicationTiming:
    """The timing of several recordings, at least one, together."""
    return PublicationTiming(
        cycles=sum(t.cycles for t in timings),
        published=sum(t.published for t in timings),
        missed=sum(t.missed for t in timings),
        late=sum(t.late for t in timings),
        agents_max=max(t.agents_max for t in timings),
        missing_agents=sum(t.missing_agents for t in timings),
        latency_ms=np.concatenate([t.latency_ms for t in timings]),
    )


def missed_cycles(observed: Int64Array, predicted: Int64Array, period_ns: int) -> int:
    """Cycles at which an observation was there and no prediction came.

    Between two predictions of times a and b every multiple a + k period that lies clearly before b
    was due, if there was an observation within half a period of it. Before the first prediction
    the multiples are counted from the first observation, which was due itself.

    Args:
        observed: [o] stamps of the observations, ascending (ns).
        predicted: [p] stamps of the predictions, ascending, each one of ``observed`` (ns).
        period_ns: wanted time between two predictions (ns).
    """
    if observed.size == 0:
        return 0
    missed = 0
    if predicted.size == 0 or predicted[0] > observed[0] + STAMP_SLACK_NS:
        predicted = np.concatenate([observed[:1], predicted])
        missed = 1
    ends = np.append(predicted[1:], observed[-1] + period_ns // 2 + 1)
    for start, end in zip(predicted.tolist(), ends.tolist(), strict=True):
        due = start + period_ns * np.arange(1, (end - start) // period_ns + 1)
        due = due[due < end - period_ns // 2]
        between = observed[(observed > start) & (observed < end)]
        if due.size and between.size:
            distance = np.abs(between[None, :] - due[:, None]).min(axis=1)
            missed += int((distance < period_ns // 2).sum())
    return missed


def timing(
    observed: Mapping[int, set[bytes]],
    received: Mapping[int, int],
    predicted: Sequence[tuple[int, int, set[bytes]]],
    rate: float,
) -> PublicationTiming:
    """PublicationTiming of one recording.

    Args:
        observed: stamp of each observation that was played (ns) -> keys of its road users.
        received: stamp of each observation -> wall clock of its receipt (ns).
        predicted: stamp, wall clock of receipt (ns) and keys of each prediction, in order.
        rate: wanted predictions per second (Hz).
    """
    period_ns = round(1e9 / rate)
    done = np.unique(np.array([stamp for stamp, _, _ in predicted], dtype=np.int64))
    missed = missed_cycles(np.array(sorted(observed), dtype=np.int64), done, period_ns)
    latency = np.array(
        [(when - received[stamp]) * 1e-6 for stamp, when, _ in predicted if stamp in received]
    )
    return PublicationTiming(
        cycles=len(done) + missed,
        published=len(predicted),
        missed=missed,
        late=int((latency > period_ns * 1e-6).sum()),
        agents_max=max(map(len, observed.values()), default=0),
        missing_agents=sum(len(observed.get(stamp, set()) - keys) for stamp, _, keys in predicted),
        latency_ms=latency,
    )
