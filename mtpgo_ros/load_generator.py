# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``load_generator``: publishes synthetic traffic and measures the predictor's answers.

Started as ``python -m mtpgo_ros.load_generator``, for example by ``mtpgo benchmark node``. It
publishes from its start, waits for the first prediction, continues for the warm-up and the
duration, and writes when each observation was published and when each prediction was received,
both on the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    answered,
    fail,
    not_negative,
    positive,
    run_as_process,
    stop_on_signals,
    tell,
)

LAST_ANSWER_S = 1.0
"""Answers are awaited this long after the last observation (s); chosen: five periods at 5 Hz."""

_BUSY_WAIT_S = 0.001
"""The thread wakes this much early and waits actively for the rest (s), since sleep alone is late;
chosen above the usual lateness."""


@dataclass(frozen=True)
class LoadPlan:
    """What to publish and for how long.

    Attributes:
        agents: vehicles in each observation.
        input_rate: observations per second (Hz).
        warm_up_s: time after the first prediction that is not measured (s).
        duration_s: time that is measured (s).
        patience_s: longest wait for the first prediction (s).
        predictor: name of the node.
        markers: subscribe to its markers as well.
    """

    agents: int
    input_rate: float
    warm_up_s: float
    duration_s: float
    patience_s: float
    predictor: str
    markers: bool


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run the load generator.

    Args:
        argv: arguments, default those of the process; ``--ros-args`` may follow ours.

    Returns:
        0 when the measurement was written, 2 for bad input or a predictor that never answered.
    """
    stopped = stop_on_signals()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered("load_generator", arguments, _parser):
        return 0
    import rclpy

    from mtpgo_ros.runtime.ros_start import own_arguments, start

    status = 0
    try:
        options = _parser().parse_args(own_arguments(arguments))
        options.output.write_text("", encoding="utf-8")  # its errors, before a long measurement
        start(arguments)
        plan = LoadPlan(**{name: getattr(options, name) for name in LoadPlan.__annotations__})
        result = _measure(plan, stopped)
        options.output.write_text(json.dumps(result), encoding="utf-8")
        tell("done")
    except OSError as error:
        status = fail("load_generator", f"{options.output} cannot be written: {error.strerror}")
    except MtpgoError as error:
        status = fail("load_generator", error)
    rclpy.try_shutdown()
    return status


def _measure(plan: LoadPlan, stopped: Callable[[], bool]) -> dict[str, Any]:
    """Publish, receive, and return the measurement.

    Raises:
        MtpgoError: no prediction or a signal was received.
    """
    from mtpgo_ros.load.load_node import LoadNode
    from mtpgo_ros.runtime.ros_start import node_errors, spin

    with node_errors():
        node = LoadNode(plan.agents, plan.predictor, plan.markers)
    over = threading.Event()
    publishing = threading.Thread(target=_publish, args=(plan, node, stopped, over), daemon=True)
    publishing.start()
    tell("ready: publishing")
    try:
        spin(node, over.is_set)
    finally:
        over.set()
        publishing.join()
        node.destroy_node()
    if stopped():
        raise MtpgoError("a signal came before the measurement was over")
    if not node.received:
        raise MtpgoError(
            f"no prediction came from {plan.predictor} within {plan.patience_s:g} s of waiting"
        )
    return node.result()


def _publish(
    plan: LoadPlan, node: Any, stopped: Callable[[], bool], over: threading.Event
) -> None:
    """Publish on a fixed schedule, so that lateness does not add up; runs on a separate thread."""
    try:
        period_s = 1.0 / plan.input_rate
        begin_s, begin_ns = time.monotonic(), time.time_ns()
        end_s, number = begin_s + plan.patience_s, 0
        while not stopped() and not over.is_set():
            due_s = begin_s + number * period_s
            if node.received and node.measured_from is None:
                node.measured_from = time.monotonic_ns() + round(plan.warm_up_s * 1e9)
                end_s = node.measured_from * 1e-9 + plan.duration_s
            if due_s > end_s:
                break
            _sleep_until(due_s)
            stamp_ns = begin_ns + round(number * period_s * 1e9)
            node.publish(number * period_s, stamp_ns)
            number += 1
        node.measured_until = time.monotonic_ns()
        if node.received and not stopped():
            _sleep_until(time.monotonic() + LAST_ANSWER_S)
    finally:
        over.set()


def _sleep_until(moment_s: float) -> None:
    """Wait until a time of the monotonic clock (s), actively at the end."""
    left_s = moment_s - time.monotonic() - _BUSY_WAIT_S
    if left_s > 0.0:
        time.sleep(left_s)
    while time.monotonic() < moment_s:
        pass


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="load_generator", description=__doc__.split("\n\n")[0])
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, help="JSON file for what was measured")
    add("--agents", type=_count, default=32, metavar="N", help="vehicles (32)")
    add("--input-rate", type=positive, default=25.0, metavar="HZ", help="observations (25)")
    add("--warm-up-s", type=not_negative, default=4.0, metavar="S", help="not measured (4)")
    add("--duration-s", type=positive, default=60.0, metavar="S", help="measured (60)")
    add("--patience-s", type=positive, default=120.0, metavar="S", help="for the first (120)")
    add("--predictor", default="/predictor", metavar="NODE", help="name of the node")
    add("--markers", action="store_true", help="subscribe to the markers as well")
    return parser


def _count(text: str) -> int:
    value = positive(text)
    if value != int(value):
        raise argparse.ArgumentTypeError(f"{text} given, expected a whole number")
    return int(value)


if __name__ == "__main__":
    run_as_process(main)
