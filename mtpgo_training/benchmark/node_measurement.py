# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measures the node: starts it and a load generator as two processes on separate cores."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Sequence
from pathlib import Path

from mtpgo_training.benchmark.measurement.process_usage import ProcessMonitor
from mtpgo_training.benchmark.node_case import NodeCase, NodeRow, evaluate
from mtpgo_training.processes.child_process import READY_S, ChildProcess, isolated

_MOST_AGENTS = 4096
"""Largest value of the parameter max_agents."""


def cores() -> tuple[set[int], set[int]]:
    """Return the node's core and the cores of all other processes; on one core both share it."""
    usable = sorted(os.sched_getaffinity(0))
    return {usable[-1]}, set(usable[:-1]) or {usable[-1]}


def parameters_of(case: NodeCase, model: Path) -> list[str]:
    """Return the node's parameters for a case, each ``name:=value``."""
    return [
        f"model:={model}",
        f"rate:={case.rate}",
        f"graph:={case.graph}",
        f"max_agents:={min(case.agents, _MOST_AGENTS)}",
        f"max_neighbours:={case.neighbours or 0}",
        f"input_timeout:={max(1.0, 1.0 / case.rate)}",
    ]


def measure(case: NodeCase, model: Path, logs: Path, parameters: Sequence[str] = ()) -> NodeRow:
    """Start both processes, wait for the end of the measurement and return its result.

    The load generator publishes before the node starts, so that the node's start is measured while
    observations arrive, as on a robot.

    Args:
        case: settings of the measurement.
        model: model file.
        logs: folder for the output of the processes.
        parameters: further parameters of the node, ``name:=value``; they override the case's.

    Raises:
        ProcessError: one of the processes failed.
    """
    one, others = cores()
    environment = isolated()
    output = logs / "measured.json"
    output.unlink(missing_ok=True)
    options = [x for p in (*parameters_of(case, model), *parameters) for x in ("-p", p)]
    with _load(case, output, logs, environment, others) as load:
        load.wait_for("ready", READY_S)
        arguments = ["--ros-args", *options]
        log = logs / "predictor.log"
        with ChildProcess("predictor", arguments, log, environment, cores=one) as node:
            monitor = ProcessMonitor(node.pid)

            def meanwhile() -> None:
                node.check()
                monitor.sample()

            load.wait(READY_S + case.warm_up_s + case.duration_s + READY_S, meanwhile)
            started_ns = node.started_ns
    return evaluate(case, json.loads(output.read_text()), monitor.usages, started_ns)


def _load(
    case: NodeCase, output: Path, logs: Path, environment: dict[str, str], on: Collection[int]
) -> ChildProcess:
    arguments = [
        *("-o", str(output)),
        *("--agents", str(case.agents)),
        *("--input-rate", str(case.input_rate)),
        *("--warm-up-s", str(case.warm_up_s)),
        *("--duration-s", str(case.duration_s)),
        *("--patience-s", str(READY_S)),
    ]
    if case.markers:
        arguments.append("--markers")
    return ChildProcess("load_generator", arguments, logs / "load.log", environment, cores=on)
