# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node and a load generator as processes of their own, each on its own cores."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Sequence
from pathlib import Path

from mtpgo_training.benchmark.node_case import Case, NodeRow, evaluate
from mtpgo_training.benchmark.process_usage import ProcessWatch
from mtpgo_training.demo.node_processes import Child, isolated
from mtpgo_training.demo.recording_session import READY_S


def cores() -> tuple[set[int], set[int]]:
    """The node's core, and those of everything else; one core serves both if there is no other."""
    usable = sorted(os.sched_getaffinity(0))
    return {usable[-1]}, set(usable[:-1]) or {usable[-1]}


def parameters_of(case: Case, model: Path) -> list[str]:
    """The node's parameters for a case, each ``name:=value``."""
    return [
        f"model:={model}",
        f"rate:={case.rate}",
        f"graph:={case.graph}",
        f"max_agents:={case.agents}",
        f"max_neighbours:={case.neighbours or 0}",
        f"input_timeout:={max(1.0, 1.0 / case.rate)}",
    ]


def measure(case: Case, model: Path, logs: Path, parameters: Sequence[str] = ()) -> NodeRow:
    """Start both processes, wait for the end of the measurement and evaluate it.

    The load generator publishes before the node starts, so that the node's start is measured as a
    robot sees it.

    Args:
        case: what to measure.
        model: file of the model.
        logs: folder for what the processes print.
        parameters: further ones of the node, ``name:=value``; they win.

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
        with Child("predictor", arguments, log, environment, cores=one) as node:
            watch = ProcessWatch(node.pid)

            def meanwhile() -> None:
                node.check()
                watch.look()

            load.wait(READY_S + case.warm_up_s + case.duration_s + READY_S, meanwhile)
            started_ns = node.started_ns
    return evaluate(case, json.loads(output.read_text()), watch.usages, started_ns)


def _load(
    case: Case, output: Path, logs: Path, environment: dict[str, str], on: Collection[int]
) -> Child:
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
    return Child("load_generator", arguments, logs / "load.log", environment, cores=on)
