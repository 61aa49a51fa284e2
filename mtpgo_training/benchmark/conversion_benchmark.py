# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark conversion``: recordings into bags and into the cache, against real time."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile

from mtpgo_core.errors import MtpgoError
from mtpgo_training.atomic_files import require_writable
from mtpgo_training.benchmark.machine import heading, markdown, write_json
from mtpgo_training.benchmark.process_usage import check_proc, read_peak_mb

_POLL_S = 0.01


@dataclass(frozen=True)
class Cost:
    """What a step took.

    Attributes:
        step: its name.
        wall_s: by the clock (s), its start included.
        cpu_s: processor time (s).
        peak_mb: the most memory that it held (10^6 bytes).
        times_real_time: duration of the recordings over ``wall_s``.
    """

    step: str
    wall_s: float
    cpu_s: float
    peak_mb: float
    times_real_time: float


def timed(step: str, arguments: Sequence[str], duration_s: float) -> Cost:
    """Run Python with arguments as a process of its own, on one core.

    Raises:
        MtpgoError: it failed.
    """
    core = {max(os.sched_getaffinity(0))}
    begin = time.monotonic()
    with TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=errors
        )
        os.sched_setaffinity(process.pid, core)
        peak_mb, pid = 0.0, 0
        while not pid:
            # The peak that wait4 tells may be this process's own, from before the child's start.
            peak_mb = max(peak_mb, read_peak_mb(process.pid))
            time.sleep(_POLL_S)
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall_s = time.monotonic() - begin
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip()
    if process.returncode != 0:
        last = said.splitlines()[-1] if said else "it said nothing"
        raise MtpgoError(f"the step {step!r} ended with status {process.returncode}: {last}")
    return Cost(
        step=step,
        wall_s=wall_s,
        cpu_s=usage.ru_utime + usage.ru_stime,
        peak_mb=peak_mb,
        times_real_time=duration_s / wall_s,
    )


def print_conversion(
    data: Path | None,
    layout: str,
    minutes: float,
    command: str,
    output: Path | None,
    reference: bool = True,
) -> list[Cost]:
    """Measure, print the table, write it.

    Args:
        data: folder of recordings; None simulates one of a highway.
        layout: of the recordings.
        minutes: length of the simulated one (min).
        command: that repeats it.
        output: JSON file, or None.
        reference: also measure the start of an empty command, which every step pays for.

    Raises:
        MtpgoError: no SUMO to simulate with, unusable recordings, a file that cannot be written.
    """
    check_proc()
    if output is not None:
        require_writable(output)
    print(heading(command))
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if data is None:
            data, layout = folder / "recordings", "highd"
            _simulate(minutes, data)
        duration_s, about = _describe(data, layout)
        print(about + "\n")
        name = "mtpgo_training.cli"
        fill = ["-m", "mtpgo_training.benchmark.fill_cache", str(data), layout]
        steps = [
            ("convert", ["-m", name, "convert", layout, str(data), "-o", str(folder / "bags")]),
            ("cache, first time", [*fill, str(folder / "cache")]),
            ("cache, again", [*fill, str(folder / "cache")]),
        ]
        if reference:
            steps.insert(0, ("start of a command", ["-m", name, "convert", "--help"]))
        costs = [timed(step, arguments, duration_s) for step, arguments in steps]
    print(table(costs))
    if output is not None:
        write_json(
            output, {"command": command, "recording_s": duration_s, "rows": [*map(vars, costs)]}
        )
    return costs


def _simulate(minutes: float, folder: Path) -> None:
    """A highway of highD's size, as CSV files like highD's own."""
    from mtpgo_training.data.writers.highd_writer import write_highd
    from mtpgo_training.simulate.highway import HighwayConfig, simulate_highway

    print(f"simulating {minutes:g} minutes of traffic (not measured)", flush=True)
    recording = simulate_highway(HighwayConfig(seconds=60.0 * minutes, seed=1), "01")
    write_highd(recording, folder, compress=False)


def _describe(data: Path, layout: str) -> tuple[float, str]:
    """Duration of the recordings (s), and a sentence about them."""
    from mtpgo_training.data.readers import load_recordings

    recordings = load_recordings(data, layout)
    duration_s = sum(recording.duration_s for recording in recordings)
    users = sum(len(recording.track_id) for recording in recordings)
    rows = sum(len(recording) for recording in recordings)
    return duration_s, (
        f"{len(recordings)} recording(s): {duration_s:.0f} s, {users} road users, {rows} rows"
    )


def table(costs: Sequence[Cost]) -> str:
    """The rows in Markdown."""
    head = ["step", "s", "processor s", "peak MB", "times real time"]
    cells = [
        [
            cost.step,
            f"{cost.wall_s:.1f}",
            f"{cost.cpu_s:.1f}",
            f"{cost.peak_mb:.0f}",
            f"{cost.times_real_time:.0f}",
        ]
        for cost in costs
    ]
    return markdown(head, cells)
