# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark node``: the real node, from a message published to its prediction received."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

from mtpgo_training.atomic_files import require_writable
from mtpgo_training.benchmark.benchmark_model import model_file
from mtpgo_training.benchmark.machine import heading, markdown, write_json
from mtpgo_training.benchmark.node_case import Case, NodeRow
from mtpgo_training.benchmark.node_measurement import measure
from mtpgo_training.benchmark.process_usage import check_proc
from mtpgo_training.demo.recording_session import check_ros

RESIDENT_MB = 450.0
FIRST_INPUT_S = 1.5


@dataclass(frozen=True)
class Bar:
    """What must hold.

    Attributes:
        case: when.
        p99_ms: the 99th percentile at most, None where only no miss is asked for.
    """

    case: Case
    p99_ms: float | None = None

    def failures(self, row: NodeRow) -> list[str]:
        """What does not hold, in words."""
        found = []
        if not row.holds:
            found.append(f"{row.misses} misses, {row.by_constant_velocity} by constant velocity")
        if self.p99_ms is not None and not row.p99_ms <= self.p99_ms:
            found.append(f"p99 {row.p99_ms:.0f} ms, asked for {self.p99_ms:.0f}")
        if not row.resident_mb <= RESIDENT_MB:
            found.append(f"{row.resident_mb:.0f} MB, asked for {RESIDENT_MB:.0f}")
        if not row.first_input_s <= FIRST_INPUT_S:
            found.append(f"first after {row.first_input_s:.1f} s, asked for {FIRST_INPUT_S}")
        return found


BARS = (
    Bar(Case(64, "scene"), p99_ms=90.0),
    Bar(Case(32, "scene"), p99_ms=40.0),
    Bar(Case(32, "scene", rate=10.0)),
    Bar(Case(128, "cover")),
    Bar(Case(32, "each", neighbours=8)),
)
"""Asked of the node with the model ``reference`` on one core."""


def check_able(output: Path | None) -> None:
    """That a measurement can be made here and its result written.

    Raises:
        ConfigurationError: it cannot.
    """
    check_ros("the benchmark")
    check_proc()
    if output is not None:
        require_writable(output)


def run_cases(
    cases: Sequence[Case], model: str, parameters: Sequence[str] = (), logs: Path | None = None
) -> list[NodeRow]:
    """Measure one case after the other.

    Args:
        cases: the cases.
        model: name or file of the model.
        parameters: further ones of the node, ``name:=value``.
        logs: folder for what the processes print; by default a temporary one.

    Raises:
        MtpgoError: no such model, or one of the processes failed.
    """
    rows = []
    with model_file(model) as path, TemporaryDirectory() as folder:
        for case in tqdm(cases, unit="case", disable=None):
            rows.append(measure(case, path, logs or Path(folder), parameters))
    return rows


def print_node(
    cases: Sequence[Case],
    model: str,
    command: str,
    output: Path | None,
    parameters: Sequence[str] = (),
) -> list[NodeRow]:
    """Measure, print the table, write it."""
    check_able(output)
    print(heading(command))
    rows = run_cases(cases, model, parameters)
    print(node_table(rows))
    if output is not None:
        write_json(output, content(rows, model, command))
    return rows


def print_bars(duration_s: float, model: str, command: str, output: Path | None) -> bool:
    """Measure what is asked of the node; whether all of it holds."""
    check_able(output)
    print(heading(command))
    bars = [
        dataclasses.replace(bar, case=dataclasses.replace(bar.case, duration_s=duration_s))
        for bar in BARS
    ]
    rows = run_cases([bar.case for bar in bars], model)
    print(node_table(rows))
    failures = [(row, bar.failures(row)) for bar, row in zip(bars, rows, strict=True)]
    for row, found in failures:
        for what in found:
            print(f"{row.agents} agents, {row.graph}, {row.rate:g} Hz: {what}")
    if output is not None:
        write_json(output, content(rows, model, command))
    holds = not any(found for _, found in failures)
    print("All that is asked for holds." if holds else "Not all that is asked for holds.")
    return holds


def print_largest(
    graphs: Sequence[str],
    case: Case,
    model: str,
    command: str,
    output: Path | None,
    *,
    step: int,
    most: int,
) -> list[NodeRow]:
    """For each policy, the largest scene that holds, and the next one, which does not."""
    check_able(output)
    print(heading(command))
    rows: list[NodeRow] = []
    with model_file(model) as path, TemporaryDirectory() as folder:
        for graph in graphs:

            def attempt(agents: int, graph: str = graph) -> NodeRow:
                tried = dataclasses.replace(case, agents=agents, graph=graph)
                print(f"  trying {agents} agents, {graph}", flush=True)
                return measure(tried, path, Path(folder))

            low, high = 0, most // step + 1  # in steps: the largest that holds, the next to try
            best: NodeRow | None = None
            while high - low > 1:
                middle = (low + high) // 2
                row = attempt(middle * step)
                if row.holds:
                    low, best = middle, row
                else:
                    high = middle
            if best is not None:
                rows.append(best)
            else:
                print(f"  no scene of {step} agents or more holds with {graph}")
    print(node_table(rows))
    if output is not None:
        write_json(output, content(rows, model, command))
    return rows


def content(rows: Sequence[NodeRow], model: str, command: str) -> dict[str, object]:
    """What the JSON file holds beside the machine."""
    return {
        "command": command,
        "model": model,
        "rows": [dataclasses.asdict(row) for row in rows],
    }


def node_table(rows: Sequence[NodeRow]) -> str:
    """The rows in Markdown."""
    head = [
        "agents",
        "graph",
        "Hz",
        "input Hz",
        "cycles",
        "misses",
        "by CV",
        "p50 ms",
        "p99 ms",
        "max ms",
        "core",
        "MB",
        "start s",
        "first s",
    ]
    return markdown(head, [_cells(row) for row in rows])


def _cells(row: NodeRow) -> list[str]:
    graph = row.graph if row.neighbours is None else f"{row.graph} ({row.neighbours})"
    return [
        str(row.agents),
        graph + (", markers" if row.markers else ""),
        f"{row.rate:g}",
        f"{row.input_rate:g}",
        str(row.cycles),
        str(row.misses),
        str(row.by_constant_velocity),
        *(
            "-" if math.isnan(value) else f"{value:.1f}"
            for value in (row.p50_ms, row.p99_ms, row.max_ms)
        ),
        f"{row.cpu_share:.0%}",
        f"{row.resident_mb:.0f}",
        f"{row.start_s:.1f}",
        f"{row.first_input_s:.2f}",
    ]
