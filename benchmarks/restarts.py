# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measure how long it takes until predictions come again after processes were killed.

``predictor``, a tracker or both are killed with SIGKILL and started again after a while, beside a
subscriber that lives on; then the predictor is ended in order. Run as
``python benchmarks/restarts.py [--repetitions 10] [--delays 0 1 5]``.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from msg_adapters.registry import input_adapter
from msg_adapters.ring_traffic import RingTraffic
from msg_adapters.types import RclpyTypes
from mtpgo_training.benchmark.measurement.machine import heading
from mtpgo_training.processes.child_process import isolated

SETTLED_S, LONGEST_S = 3.0, 60.0
KILLED = ("predictor", "tracker", "both")


def track(agents: int, rate_hz: float) -> None:
    """Be the tracker: publish observations until a signal comes."""
    rclpy.init()
    publisher = rclpy.create_node("tracker").create_publisher(PointCloud2, "objects", 5)
    traffic, types = RingTraffic(agents), RclpyTypes()
    adapter = input_adapter("pointcloud2")
    begin_s, step = time.monotonic(), 0
    while rclpy.ok():
        states = traffic.at(step / rate_hz, time.time_ns())
        publisher.publish(adapter.from_states(states, types))
        if step == 0:
            print("ready", flush=True)
        step += 1
        time.sleep(max(0.0, begin_s + step / rate_hz - time.monotonic()))


class Started:
    """A process that says when it is ready, and the time at which it did (s)."""

    def __init__(self, words: list[str], folder: Path) -> None:
        self.log = folder / f"{time.monotonic_ns()}.log"
        with self.log.open("wb") as output:
            command = [sys.executable, "-u", "-W", "ignore", *words]
            self.process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        self.ready_s = 0.0

    def look(self) -> None:
        """Note the time if it is ready now."""
        if not self.ready_s and "ready" in self.log.read_text(errors="replace"):
            self.ready_s = time.monotonic()

    def end(self, number: int) -> float:
        """Send a signal; return how long it takes to end (s)."""
        begin_s = time.monotonic()
        self.process.send_signal(number)
        self.process.wait()
        return time.monotonic() - begin_s


class Bench:
    """The processes, and a subscriber of the predictions."""

    def __init__(self, agents: int, rate_hz: float, folder: Path) -> None:
        self._folder = folder
        self._words = {
            "predictor": ["-m", "mtpgo_ros.predictor"],
            "tracker": [__file__, "--track", "--agents", str(agents), "--rate", str(rate_hz)],
        }
        self._received_s: list[float] = []
        self._node = rclpy.create_node("subscriber")
        self._node.create_subscription(PointCloud2, "/predictor/predictions", self._on, 10)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.running = {name: self._start(name) for name in self._words}
        self.predicted_after(time.monotonic())

    def _on(self, prediction: PointCloud2) -> None:
        if prediction.width:
            self._received_s.append(time.monotonic())

    def _start(self, name: str) -> Started:
        return Started(self._words[name], self._folder)

    def _spin(self, until: Callable[[], bool], limit_s: float) -> None:
        end_s = time.monotonic() + limit_s
        while not until() and time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=0.01)

    def predicted_after(self, from_s: float) -> float:
        """Return the time of the first prediction after a time, while all is ready (s)."""
        running = list(self.running.values())

        def predicted() -> bool:
            for one in running:
                one.look()
            ready = all(one.ready_s for one in running)
            return ready and bool(self._received_s) and self._received_s[-1] > from_s

        self._spin(predicted, LONGEST_S)
        if not predicted():
            raise SystemExit(f"no prediction within {LONGEST_S:.0f} s, see {self._folder}")
        return next(at_s for at_s in self._received_s if at_s > from_s)

    def restart(self, names: list[str], delay_s: float) -> float:
        """Kill processes and start them again; return the time until predictions come (s)."""
        self._spin(lambda: False, SETTLED_S)
        for name in names:
            self.running[name].end(signal.SIGKILL)
        self._spin(lambda: False, delay_s)
        begin_s = time.monotonic()
        for name in names:
            self.running[name] = self._start(name)
        first_s = self.predicted_after(begin_s)
        return max(0.0, first_s - max(self.running[name].ready_s for name in names))

    def end(self, repetitions: int) -> list[float]:
        """End the predictor in order while it predicts, again and again; return the times (s)."""
        found = []
        for _ in range(repetitions):
            self._spin(lambda: False, SETTLED_S)
            found.append(self.running["predictor"].end(signal.SIGTERM))
            begin_s = time.monotonic()
            self.running["predictor"] = self._start("predictor")
            self.predicted_after(begin_s)
        return found

    def close(self) -> None:
        """End all."""
        for one in self.running.values():
            one.end(signal.SIGINT)
        self._executor.shutdown()
        self._node.destroy_node()


def shown(times_s: list[float]) -> str:
    """Return the median and the longest of some times (s)."""
    return f"{np.median(times_s):.2f} s, at most {max(times_s):.2f} s"


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=10)
    parser.add_argument("--delays", type=float, nargs="+", default=[0.0, 1.0, 5.0])
    parser.add_argument("--agents", type=int, default=16)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--track", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.track:
        track(args.agents, args.rate)
        return
    os.environ.update(isolated())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    print(heading(" ".join(["python", *sys.argv])))
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(args.agents, args.rate, Path(folder))
        print("| killed |" + "".join(f" after {delay:g} s |" for delay in args.delays))
        print("|---|" + "---|" * len(args.delays))
        for who in KILLED:
            names = list(KILLED[:2]) if who == "both" else [who]
            cells = [
                shown([bench.restart(names, delay) for _ in range(args.repetitions)])
                for delay in args.delays
            ]
            print(f"| {who} | {' | '.join(cells)} |", flush=True)
        print(f"\nSIGTERM ends the predictor after {shown(bench.end(args.repetitions))}")
        bench.close()


if __name__ == "__main__":
    main()
