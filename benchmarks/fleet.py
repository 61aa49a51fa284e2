# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measure `mtpgo data` and `mtpgo evaluate` on many small bags, with one process and with several.

Makes the bags first, the last one cut within its first chunk. Run as
``python benchmarks/fleet.py DIR [--bags 500] [--jobs 1 2] [--command data evaluate]``; DIR keeps
the bags.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import psutil

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.registry import input_adapter
from msg_adapters.ring_traffic import RingTraffic
from mtpgo_training.benchmark.measurement.machine import heading

SECONDS, RATE_HZ = 20, 10
POLL_S = 0.2
COMMANDS = {
    "data": ["data", "--no-cache"],
    "evaluate": ["evaluate", "--model", "default", "--no-cache", "--stride", "1", "--no-centre"],
}


def make_bags(folder: Path, count: int) -> None:
    """Write the bags that are not there yet, each with 8 to 39 vehicles."""
    adapter = input_adapter("pointcloud2")
    for i in range(count):
        path = folder / f"bag{i:04d}.mcap"
        if path.exists():
            continue
        traffic = RingTraffic(8 + i % 32)
        with McapWriter(path) as bag:
            bag.add_topic("/objects", adapter.message_type)
            for step in range(SECONDS * RATE_HZ):
                stamp_ns = (1_700_000_000 + 100 * i) * 10**9 + step * 10**9 // RATE_HZ
                states = traffic.at(i + step / RATE_HZ, stamp_ns)
                bag.write("/objects", stamp_ns, adapter.from_states(states, bag.types))
    path.write_bytes(path.read_bytes()[:200])


def measure(words: list[str], jobs: int) -> tuple[float, float, float, int]:
    """Run a command; return time (s), peak memory in the first fifth and later (MB), status."""
    begin = time.monotonic()
    process = psutil.Popen(
        [sys.executable, "-m", "mtpgo_training.cli", *words, "--jobs", str(jobs)],
        stdout=subprocess.DEVNULL,
    )
    seen = []
    while process.poll() is None:
        total = 0
        for one in [process, *process.children(recursive=True)]:
            try:
                total += one.memory_full_info().pss
            except psutil.Error:
                continue
        seen.append((time.monotonic() - begin, total / 1e6))
        time.sleep(POLL_S)
    wall_s = time.monotonic() - begin
    early = max(mb for at_s, mb in seen if at_s <= max(wall_s / 5, seen[0][0]))
    return wall_s, early, max(mb for _, mb in seen), process.returncode


def main() -> None:
    """Make the bags, run the commands and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--bags", type=int, default=500)
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--command", nargs="+", choices=COMMANDS, default=list(COMMANDS))
    args = parser.parse_args()
    args.directory.mkdir(parents=True, exist_ok=True)
    make_bags(args.directory, args.bags)
    print(heading(" ".join(["python", *sys.argv])))
    print("| command | processes | s | times faster | MB, first fifth | MB, most | status |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for name in args.command:
        words, first_s = [*COMMANDS[name], "--data", str(args.directory), "--layout", "bag"], 0.0
        for jobs in args.jobs:
            wall_s, early, most, status = measure(words, jobs)
            first_s = first_s or wall_s
            print(
                f"| {name} | {jobs} | {wall_s:.1f} | {first_s / wall_s:.2f} | {early:.0f} "
                f"| {most:.0f} | {status} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
