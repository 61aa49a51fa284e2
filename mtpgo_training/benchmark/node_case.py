# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One measurement of the node: its settings, and its result computed from the recorded times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mtpgo_training.benchmark.measurement.process_usage import Usage, cpu_share, largest_mb
from mtpgo_training.demo.publication_timing import missed_cycles


@dataclass(frozen=True)
class NodeCase:
    """Settings of one measurement.

    Attributes:
        agents: road users in each observation.
        graph: graph policy.
        rate: predictions per second (Hz).
        input_rate: observations per second (Hz).
        duration_s: measured time (s).
        neighbours: most agents of a graph besides its centre, None as the model was trained.
        markers: the markers have a subscriber.
        warm_up_s: time after the first prediction that is not measured (s); the histories, 3 s
            long, fill in it.
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
        """Time between two predictions, and the deadline of each (ms)."""
        return 1e3 / self.rate


@dataclass(frozen=True)
class NodeRow:
    """Result of one measurement, one row of the table.

    Latency is the time from the publication of an observation by the load generator to the receipt
    of its prediction by the same process.

    Attributes:
        agents: road users in each observation.
        graph: graph policy.
        neighbours: most agents of a graph besides its centre, None as the model was trained.
        rate: predictions per second (Hz).
        input_rate: observations per second (Hz).
        markers: the markers had a subscriber.
        cycles: predictions that were due.
        misses: due predictions that were not received within one period.
        by_constant_velocity: received predictions in which at least one agent was predicted by
            constant velocity instead of the model.
        p50_ms, p99_ms, max_ms: median, 99th percentile and maximum of the latency (ms); NaN
            without a prediction.
        cpu_share: processor time of the node per elapsed time, 1 for one whole core.
        resident_mb: largest resident memory of the node (10^6 bytes).
        start_s: time from the start of the node's process to the first prediction (s).
        first_input_s: time from the first observation that the node could receive to the first
            prediction (s).
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
        """Whether every due prediction was received in time and computed by the model."""
        return self.cycles > 0 and self.misses == 0 and self.by_constant_velocity == 0

    @property
    def graph_label(self) -> str:
        """Graph policy with its number of neighbours and markers, as the table shows it."""
        graph = self.graph if self.neighbours is None else f"{self.graph} ({self.neighbours})"
        return graph + (", markers" if self.markers else "")


def evaluate(
    case: NodeCase, raw: Mapping[str, Any], usages: Sequence[Usage], started_ns: int
) -> NodeRow:
    """Return the result of one measurement.

    Args:
        case: its settings.
        raw: output of the load generator: ``published`` [stamp, time], ``received`` [stamp, time,
            agents, number of these by constant velocity], ``heard_from_stamp``, ``measured_from``
            and ``measured_until``; all times in ns of the monotonic clock.
        usages: samples of the node's process.
        started_ns: start of that process (ns, monotonic clock).
    """
    published = {int(stamp): int(when) for stamp, when in raw["published"]}
    received = {int(entry[0]): entry for entry in raw["received"]}
    begin, end = int(raw["measured_from"]), int(raw["measured_until"])
    period_ns = round(1e9 / case.rate)

    inside = np.array([s for s, when in published.items() if begin <= when <= end], dtype=np.int64)
    predicted = np.array(sorted(s for s in received if s in published), dtype=np.int64)
    # The last prediction before the measurement sets the phase of the cycles.
    before = predicted[predicted < inside.min(initial=np.iinfo(np.int64).max)][-1:]
    measured = predicted[np.isin(predicted, inside)]
    missed = missed_cycles(
        np.concatenate([before, np.sort(inside)]),
        np.concatenate([before, measured]),
        period_ns,
    )
    latency = np.array([(int(received[s][1]) - published[s]) * 1e-6 for s in measured.tolist()])
    first_ns = min((int(entry[1]) for entry in raw["received"]), default=0)
    # The writer learns of the node's subscription after the node can receive, sometimes an
    # observation later: an observation that was predicted was received, whatever was known.
    heard_from = raw["heard_from_stamp"]
    could_receive = [*predicted[:1].tolist(), *([] if heard_from is None else [int(heard_from)])]
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
        first_input_s=(first_ns - published[min(could_receive)]) * 1e-9
        if could_receive
        else float("nan"),
    )
