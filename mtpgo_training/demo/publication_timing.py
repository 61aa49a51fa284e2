# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts late, missing and incomplete predictions from the recorded messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.track_index import SortKeyArray

Int64Array = NDArray[np.int64]

STAMP_SLACK_NS = 1_000
"""Stamps closer than this count as equal (ns): bags and messages round differently."""


@dataclass(frozen=True)
class PublicationTiming:
    """Punctuality and completeness of the predictions of one recording.

    Attributes:
        cycles: predictions that were due at the configured rate.
        published: predictions that were received.
        missed: cycles without a prediction.
        late: predictions received more than one period after their observation.
        agents_max: most road users in one observation.
        missing_agents: road users observed at a predicted time but not in its prediction.
        latency_ms: [published] time from the receipt of an observation to the receipt of its
            prediction (ms).
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
        """Cycles whose prediction was late or missing."""
        return self.missed + self.late


def merge_timings(timings: Sequence[PublicationTiming]) -> PublicationTiming:
    """Return the timing of several recordings, at least one, taken together."""
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
    """Return the number of cycles with an observation and without a prediction.

    Between two predictions at times a and b, each time a + k * period that is at least half a
    period before b was due if there was an observation within half a period of it. Before the
    first prediction the cycles are counted from the first observation, which was due itself.

    Args:
        observed: [o] stamps of the observations, ascending (ns).
        predicted: [p] stamps of the predictions, ascending, each one of ``observed`` (ns).
        period_ns: configured time between two predictions (ns).
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
    observed: Mapping[int, SortKeyArray],
    received: Mapping[int, int],
    predicted: Sequence[tuple[int, int, SortKeyArray]],
    rate: float,
) -> PublicationTiming:
    """Return the timing of one recording.

    Args:
        observed: stamp of each observation that was played (ns) -> [n] names of its road users,
            see :func:`~mtpgo_core.history.track_index.sort_keys`.
        received: stamp of each observation (ns) -> time of its receipt (ns, wall clock).
        predicted: stamp (ns), time of receipt (ns, wall clock) and [m] names of the road users of
            each prediction, in order of receipt.
        rate: configured predictions per second (Hz).
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
        missing_agents=sum(
            int(np.isin(observed[stamp], names, invert=True).sum())
            for stamp, _, names in predicted
            if stamp in observed
        ),
        latency_ms=latency,
    )
