# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is asked of the node in one measurement, and what was found, from the raw times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mtpgo_training.benchmark.process_usage import Usage, cpu_share, largest_mb
from mtpgo_training.demo.publication_timing import missed_cycles


@dataclass(frozen=True)
class Case:
    """One measurement.

    Attributes:
        agents: road users in each observation.
        graph: policy.
        rate: predictions per second (Hz).
        input_rate: observations per second (Hz).
        duration_s: how long is measured (s).
        neighbours: agents of a graph beside its centre, None as the model was trained.
        markers: somebody listens to the markers.
        warm_up_s: time after the first prediction that is not measured (s).
    """

    agents: int
    graph: str = "scene"
    rate: float = 5.0
    input_rate: float = 25.0
    duration_s: float = 60.0
    neighbours: int | None = None
    markers: bool = False
    warm_up_s: float = 4.0

    @property
    def period_ms(self) -> float:
        """Between two predictions, and the deadline of each (ms)."""
        return 1e3 / self.rate


@dataclass(frozen=True)
class NodeRow:
    """One line of the table.

    Latencies run from an observation's publication in one process, through the node in another,
    to the receipt of its prediction in the first.

    Attributes:
        agents: road users.
        graph: policy.
        neighbours: most in a graph beside its centre, None as the model was trained.
        rate, input_rate: Hz.
        markers: somebody listened to the markers.
        cycles: predictions that were due.
        misses: of these, those that did not come within a period.
        by_constant_velocity: of those that came, those with an agent that the model did not serve.
        p50_ms, p99_ms, max_ms: latency; NaN without a prediction.
        cpu_share: processor time of the node per time, 1 for a whole core.
        resident_mb: the most memory that it held (10^6 bytes).
        start_s: from the start of its process to the first prediction (s).
        first_input_s: from the first observation that it could hear to the first prediction (s).
    """

    agents: int
    graph: str
    neighbours: int | None
    rate: float
    input_rate: float
    markers: bool
    cycles: int
    misses: int
    by_constant_velocity: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    cpu_share: float
    resident_mb: float
    start_s: float
    first_input_s: float

    @property
    def holds(self) -> bool:
        """Every due prediction came in time, and from the model."""
        return self.cycles > 0 and self.misses == 0 and self.by_constant_velocity == 0


def evaluate(
    case: Case, raw: Mapping[str, Any], usages: Sequence[Usage], started_ns: int
) -> NodeRow:
    """What was found.

    Args:
        case: what was asked.
        raw: what the load generator noted: ``published`` [stamp, time], ``received`` [stamp, time,
            agents, of these by constant velocity], ``heard_from_stamp``, ``measured_from`` and
            ``measured_until``; all times in ns of the monotonic clock.
        usages: of the node's process.
        started_ns: when that was started.
    """
    published = {int(stamp): int(when) for stamp, when in raw["published"]}
    received = {int(entry[0]): entry for entry in raw["received"]}
    begin, end = int(raw["measured_from"]), int(raw["measured_until"])
    period_ns = round(1e9 / case.rate)

    inside = np.array([s for s, when in published.items() if begin <= when <= end], dtype=np.int64)
    predicted = np.array(sorted(s for s in received if s in published), dtype=np.int64)
    # Cycles count from the last prediction before the measurement, which gives them their phase.
    before = predicted[predicted < inside.min(initial=np.iinfo(np.int64).max)][-1:]
    measured = predicted[np.isin(predicted, inside)]
    missed = missed_cycles(
        np.concatenate([before, np.sort(inside)]),
        np.concatenate([before, measured]),
        period_ns,
    )
    latency = np.array([(int(received[s][1]) - published[s]) * 1e-6 for s in measured.tolist()])
    first_ns = min((int(entry[1]) for entry in raw["received"]), default=0)
    heard = raw["heard_from_stamp"]
    p50, p99 = np.percentile(latency, (50, 99)) if len(latency) else (np.nan, np.nan)
    return NodeRow(
        agents=case.agents,
        graph=case.graph,
        neighbours=case.neighbours,
        rate=case.rate,
        input_rate=case.input_rate,
        markers=case.markers,
        cycles=len(measured) + missed,
        misses=missed + int((latency > case.period_ms).sum()),
        by_constant_velocity=sum(received[s][3] > 0 for s in measured.tolist()),
        p50_ms=float(p50),
        p99_ms=float(p99),
        max_ms=float(latency.max()) if len(latency) else float("nan"),
        cpu_share=cpu_share(usages, begin, end),
        resident_mb=largest_mb(usages),
        start_s=(first_ns - started_ns) * 1e-9,
        first_input_s=(first_ns - published[int(heard)]) * 1e-9 if heard else float("nan"),
    )
