# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark node``: latency of the real node, message to prediction."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

from mtpgo_training.benchmark.measurement.benchmark_model import model_file
from mtpgo_training.benchmark.measurement.machine import print_heading, table, write_json
from mtpgo_training.benchmark.measurement.process_usage import require_linux
from mtpgo_training.benchmark.node_case import NodeCase, NodeRow
from mtpgo_training.benchmark.node_measurement import measure
from mtpgo_training.processes.child_process import require_ros

RESIDENT_MB = 450.0
"""Most resident memory allowed to the node (10^6 bytes); measured: 376 to 401."""

FIRST_INPUT_S = 1.5
"""Longest time from the first observation that the node can receive to its first prediction
(s); measured: 0.02 to 0.16."""

_COLUMNS = {
    "agents": "{.agents}",
    "graph": "{.graph_label}",
    "Hz": "{.rate:g}",
    "input Hz": "{.input_rate:g}",
    "cycles": "{.cycles}",
    "misses": "{.misses}",
    "by CV": "{.by_constant_velocity}",
    "p50 ms": "{.p50_ms:.1f}",
    "p99 ms": "{.p99_ms:.1f}",
    "max ms": "{.max_ms:.1f}",
    "core": "{.cpu_share:.0%}",
    "MB": "{.resident_mb:.0f}",
    "start s": "{.start_s:.1f}",
    "first s": "{.first_input_s:.2f}",
}


@dataclass(frozen=True)
class Requirement:
    """What must hold in one measurement, besides ``RESIDENT_MB`` and ``FIRST_INPUT_S``.

    Attributes:
        case: settings of the measurement.
        p99_ms: largest 99th percentile of the latency (ms), None without a limit.
    """

    case: NodeCase
    p99_ms: float | None = None

    def violations(self, row: NodeRow) -> list[str]:
        """Return a phrase for each limit that the result exceeds."""
        found = []
        if not row.holds:
            found.append(f"{row.misses} misses, {row.by_constant_velocity} by constant velocity")
        if self.p99_ms is not None and not row.p99_ms <= self.p99_ms:
            found.append(f"p99 {row.p99_ms:.0f} ms, required: {self.p99_ms:.0f}")
        if not row.resident_mb <= RESIDENT_MB:
            found.append(f"{row.resident_mb:.0f} MB, required: {RESIDENT_MB:.0f}")
        if not row.first_input_s <= FIRST_INPUT_S:
            found.append(f"first after {row.first_input_s:.1f} s, required: {FIRST_INPUT_S}")
        return found


REQUIREMENTS = (
    Requirement(NodeCase(64, "scene"), p99_ms=90.0),
    Requirement(NodeCase(32, "scene"), p99_ms=40.0),
    Requirement(NodeCase(32, "scene", rate=10.0)),
    Requirement(NodeCase(128, "cover")),
    Requirement(NodeCase(32, "each", neighbours=8)),
)
"""Required of the node with the model ``reference`` on one core; docs/performance.md
has the measured values."""


def require_node_tools() -> None:
    """Check that the node can be started and measured on this machine.

    Raises:
        ConfigurationError: it cannot.
    """
    require_ros("the benchmark")
    require_linux()


def run_cases(
    cases: Sequence[NodeCase], model: str, parameters: Sequence[str] = ()
) -> list[NodeRow]:
    """Measure one case after the other.

    Args:
        cases: settings of each measurement.
        model: name or file of the model.
        parameters: further parameters of the node, ``name:=value``.

    Raises:
        MtpgoError: there is no such model, or one of the processes failed.
    """
    with model_file(model) as path, TemporaryDirectory() as folder:
        return [
            measure(case, path, Path(folder), parameters)
            for case in tqdm(cases, unit="case", disable=None)
        ]


def print_node(
    cases: Sequence[NodeCase],
    model: str,
    command: str,
    output: Path | None,
    parameters: Sequence[str] = (),
) -> list[NodeRow]:
    """Measure some cases, print the table and write it."""
    require_node_tools()
    print_heading(command, output)
    rows = run_cases(cases, model, parameters)
    _report(rows, model, command, output)
    return rows


def print_requirements(duration_s: float, model: str, command: str, output: Path | None) -> bool:
    """Measure every case of ``REQUIREMENTS``, print and write the result.

    Returns:
        Whether all requirements hold.
    """
    require_node_tools()
    print_heading(command, output)
    cases = [dataclasses.replace(each.case, duration_s=duration_s) for each in REQUIREMENTS]
    rows = run_cases(cases, model)
    _report(rows, model, command, output)
    holds = True
    for requirement, row in zip(REQUIREMENTS, rows, strict=True):
        for violation in requirement.violations(row):
            holds = False
            print(f"{row.agents} agents, {row.graph}, {row.rate:g} Hz: {violation}")
    print("All requirements hold." if holds else "Not all requirements hold.")
    return holds


def print_largest(
    graphs: Sequence[str],
    case: NodeCase,
    model: str,
    command: str,
    output: Path | None,
    *,
    step: int,
    most: int,
) -> list[NodeRow]:
    """Search the largest scene of each policy in which every prediction is in time.

    Args:
        graphs: graph policies.
        case: the other settings.
        model: name or file of the model.
        command: command that repeats the measurement.
        output: JSON file, or None.
        step: the sizes tried are multiples of this number of agents.
        most: largest size tried.

    Returns:
        The result of the largest scene of each policy, without policies that have none.
    """
    require_node_tools()
    print_heading(command, output)
    rows: list[NodeRow] = []
    with model_file(model) as path, TemporaryDirectory() as folder:
        for graph in graphs:
            low, high = 0, most // step + 1  # in steps: the largest that holds, the next to try
            best: NodeRow | None = None
            while high - low > 1:
                middle = (low + high) // 2
                print(f"  trying {middle * step} agents, {graph}", flush=True)
                tried = dataclasses.replace(case, agents=middle * step, graph=graph)
                row = measure(tried, path, Path(folder))
                if row.holds:
                    low, best = middle, row
                else:
                    high = middle
            if best is not None:
                rows.append(best)
            else:
                print(f"  no scene of {step} agents or more holds with {graph}")
    _report(rows, model, command, output)
    return rows


def node_table(rows: Sequence[NodeRow]) -> str:
    """Return the results as a Markdown table."""
    return table(rows, _COLUMNS)


def _report(rows: Sequence[NodeRow], model: str, command: str, output: Path | None) -> None:
    print(node_table(rows))
    plain = [dataclasses.asdict(row) for row in rows]
    write_json(output, {"command": command, "model": model, "rows": plain})
