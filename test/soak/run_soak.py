# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs the node for a long time and measures what it keeps: ``make soak SECONDS=1800``.

First the node predicts 64 road users at 25 Hz that come and go. Then a second one is configured,
activated, deactivated and cleaned up 500 times. Measured from outside, every ten seconds or cycle:
resident memory, threads and open files of the process. The exit status is 1 if the memory grows by
1 MB or more in ten minutes (after the first five), if threads or open files grow, or if a cycle
was missed.

    python test/soak/run_soak.py --seconds 1800 --cycles 500
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))

AGENTS, INPUT_HZ = 64, 25.0
STAY_S, AWAY_S = 20.0, 2.0
"""How long a road user is seen, and until another takes its place (s); chosen."""

SETTLING_S = 300.0
"""Memory of the first five minutes is not judged (s), as in the promise."""

SAMPLE_S = 10.0
MOST_LINES = 20
"""Warnings of the node's log that are printed, such as where the time of a late cycle went."""

LARGEST_SLOPE_MB = 1.0
"""Largest growth of the resident memory in ten minutes (MB)."""


@dataclass(frozen=True)
class Sample:
    """What a process has.

    Attributes:
        time_s: since the start (s).
        memory_mb: resident (MB).
        threads: their number.
        files: open file descriptors.
    """

    time_s: float
    memory_mb: float
    threads: int
    files: int


def main() -> int:
    """Run the command line; returns 1 if a limit was exceeded."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--cycles", type=int, default=500, help="of configure and clean up")
    parser.add_argument("--model", default="default")
    arguments = parser.parse_args()
    import rclpy

    rclpy.init()
    faults = []
    if arguments.seconds > 0:
        faults += _predict(arguments.seconds, arguments.model)
    if arguments.cycles > 0:
        faults += _configure(arguments.cycles, arguments.model)
    rclpy.try_shutdown()
    for fault in faults:
        print(f"FAULT: {fault}")
    print("within the limits" if not faults else f"{len(faults)} limits exceeded")
    return 1 if faults else 0


def start(model: str, log: IO[bytes] | int, *parameters: str) -> subprocess.Popen[bytes]:
    """Start a node whose log goes into a file, or to ``subprocess.DEVNULL``."""
    given = [f"model:={model}", *parameters]
    options = [part for text in given for part in ("-p", text)]
    return subprocess.Popen(
        [sys.executable, "-m", "mtpgo_ros.predictor", "--ros-args", *options],
        stdout=log,
        stderr=subprocess.STDOUT,
    )


def sample(pid: int, since: float) -> Sample:
    """Return what a process has now."""
    import psutil

    process = psutil.Process(pid)
    with process.oneshot():
        return Sample(
            time.monotonic() - since,
            process.memory_info().rss / 2**20,
            process.num_threads(),
            process.num_fds(),
        )


def slope_mb(samples: list[Sample]) -> float:
    """Return the growth of the memory in ten minutes (MB), by least squares."""
    import numpy as np

    time_s = np.array([one.time_s for one in samples])
    memory = np.array([one.memory_mb for one in samples])
    if len(samples) < 3:
        return 0.0
    return float(np.polyfit(time_s, memory, 1)[0] * 600.0)


def faults_of(samples: list[Sample], settled: list[Sample], what: str) -> list[str]:
    """Return what exceeds a limit, and print the figures."""
    first, last = settled[0], settled[-1]
    growth = slope_mb(settled)
    print(
        f"{what}: {last.time_s:.0f} s, memory {samples[0].memory_mb:.1f} MB at first,"
        f" {first.memory_mb:.1f} MB after {first.time_s:.0f} s, {last.memory_mb:.1f} MB at last,"
        f" slope {growth:+.2f} MB in 10 min; threads {first.threads} -> {last.threads};"
        f" files {first.files} -> {last.files}",
        flush=True,
    )
    step = max(1, len(samples) // 12)
    print("  memory (MB): " + " ".join(f"{one.memory_mb:.1f}" for one in samples[::step]))
    out = []
    if growth >= LARGEST_SLOPE_MB:
        out.append(f"{what}: memory grows by {growth:.2f} MB in 10 min")
    for name in ("threads", "files"):
        before, after = getattr(first, name), getattr(last, name)
        if after > before:
            out.append(f"{what}: {name} grow from {before} to {after}")
    return out


def _predict(seconds: float, model: str) -> list[str]:
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from sensor_msgs.msg import PointCloud2

    from msg_adapters.inputs.object_cloud import states_to_pointcloud2
    from msg_adapters.ring_traffic import RingTraffic
    from msg_adapters.types import RclpyTypes

    node = Node("soak")
    publisher = node.create_publisher(PointCloud2, "objects", 10)
    counts: dict[str, str] = {}
    answers = [0]

    def on_prediction(_: object) -> None:
        answers[0] += 1

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            counts.update({pair.key: pair.value for pair in status.values})

    node.create_subscription(PointCloud2, "predictor/predictions", on_prediction, 10, raw=True)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    log = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
    predictor = start(model, log)
    traffic, types = RingTraffic(AGENTS), RclpyTypes()
    samples: list[Sample] = []
    begin = time.monotonic()
    number, first_answer, waited = 0, None, 120.0
    try:
        while predictor.poll() is None:
            now = time.monotonic() - begin
            if first_answer is None and answers[0]:
                first_answer = now
            if first_answer is None and now > waited:
                return [f"prediction: no answer within {waited:g} s"]
            if first_answer is not None and now - first_answer > seconds:
                break
            due = number / INPUT_HZ
            if now < due:
                executor.spin_once(timeout_sec=due - now)
                continue
            states = _coming_and_going(traffic.at(due, time.time_ns()), due)
            publisher.publish(states_to_pointcloud2(states, types))
            number += 1
            if first_answer is not None and now - first_answer >= len(samples) * SAMPLE_S:
                samples.append(sample(predictor.pid, begin + first_answer))
    finally:
        ended = predictor.poll()
        predictor.send_signal(signal.SIGINT)
        predictor.wait(30)
        executor.shutdown()
        node.destroy_node()
    if ended is not None:
        return [f"prediction: the node ended with status {ended}"]
    after = min(SETTLING_S, seconds / 2)
    settled = [one for one in samples if one.time_s >= after] or samples
    faults = faults_of(samples, settled, "prediction")
    missed = {name: counts.get(name, "0") for name in ("deadline_misses", "cycles_failed")}
    print(
        f"prediction: {answers[0]} predictions of {number} observations, deadline misses"
        f" {missed['deadline_misses']}, failed cycles {missed['cycles_failed']}, latency p99"
        f" {counts.get('latency_ms_p99', '?')} ms"
    )
    log.seek(0)
    lines = log.read().decode(errors="replace").splitlines()
    warnings = [line for line in lines if "[WARN]" in line or "[ERROR]" in line]
    for line in warnings[:MOST_LINES]:
        print(f"  {line}")
    faults += [f"prediction: {name} is {n}" for name, n in missed.items() if n not in ("0", "")]
    return faults


def _coming_and_going(states, time_s: float):
    """Return the road users that are seen at a time; one that returns has a new identity."""
    import dataclasses

    import numpy as np

    slot = np.arange(len(states.key))
    life, phase = np.divmod(time_s + slot * (STAY_S + AWAY_S) / len(slot), STAY_S + AWAY_S)
    seen = phase < STAY_S
    key = states.key.copy()
    key[:, 1] = life.astype(np.uint32)
    columns = {
        field.name: getattr(states, field.name)[seen]
        for field in dataclasses.fields(states)
        if isinstance(getattr(states, field.name), np.ndarray)
    }
    return dataclasses.replace(states, **{**columns, "key": key[seen]})


def _configure(cycles: int, model: str) -> list[str]:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    node = Node("soak_configure")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    predictor = start(model, subprocess.DEVNULL, "autostart:=false")
    client = node.create_client(ChangeState, "predictor/change_state")
    steps = (
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_ACTIVATE,
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
    )
    samples: list[Sample] = []
    begin = time.monotonic()
    try:
        if not client.wait_for_service(120.0):
            return ["configuration: the node did not start within 120 s"]
        for _ in range(cycles):
            for step in steps:
                request = ChangeState.Request(transition=Transition(id=step))
                future = client.call_async(request)
                executor.spin_until_future_complete(future, 60.0)
                answer = future.result() if future.done() else None
                if answer is None or not answer.success:
                    what = "was refused" if answer is not None else "was not answered in 60 s"
                    what = what if predictor.poll() is None else "ended the node"
                    return [f"configuration: transition {step} {what} in cycle {len(samples)}"]
            samples.append(sample(predictor.pid, begin))
    finally:
        predictor.send_signal(signal.SIGINT)
        predictor.wait(30)
        executor.shutdown()
        node.destroy_node()
    settled = samples[min(len(samples) // 5, 50) :]
    faults = faults_of(samples, settled, f"{cycles} configurations")
    # Growth by cycles, not by time: 500 cycles may add what ten minutes may.
    kept = [fault for fault in faults if "memory" not in fault]
    grown = settled[-1].memory_mb - settled[0].memory_mb
    if grown >= LARGEST_SLOPE_MB * max(1.0, cycles / 100):
        kept.append(f"configuration: memory grows by {grown:.1f} MB in {len(settled)} cycles")
    return kept


if __name__ == "__main__":
    sys.exit(main())
