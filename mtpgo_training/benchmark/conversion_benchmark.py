# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo benchmark conversion``: time and memory of converting and caching recordings."""

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
from mtpgo_training.benchmark.measurement.machine import print_heading, table, write_json
from mtpgo_training.benchmark.measurement.process_usage import read_peak_mb, require_linux

_POLL_S = 0.01
"""Time between two looks at the process (s). Chosen: short against the shortest step, 0.5 s."""

_COLUMNS = {
    "step": "{.step}",
    "s": "{.wall_s:.1f}",
    "processor s": "{.cpu_s:.1f}",
    "peak MB": "{.peak_mb:.0f}",
    "times real time": "{.times_real_time:.0f}",
}


@dataclass(frozen=True)
class StepCost:
    """Time and memory that one step took.

    Attributes:
        step: its name.
        wall_s: elapsed time (s), start of the process included.
        cpu_s: processor time (s).
        peak_mb: peak resident memory (10^6 bytes).
        times_real_time: duration of the recordings over ``wall_s``.
    """

    step: str
    wall_s: float
    cpu_s: float
    peak_mb: float
    times_real_time: float


def timed(step: str, arguments: Sequence[str], duration_s: float) -> StepCost:
    """Run Python with some arguments in a new process on one core and measure it.

    Args:
        step: name of the step.
        arguments: command line after ``python``.
        duration_s: duration of the recordings (s).

    Raises:
        MtpgoError: the process failed.
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
            # Not ru_maxrss of wait4: it includes this process's memory from before the exec.
            peak_mb = max(peak_mb, read_peak_mb(process.pid))
            time.sleep(_POLL_S)
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall_s = time.monotonic() - begin
        errors.seek(0)
        message = errors.read().decode(errors="replace").strip()
    if process.returncode != 0:
        last = message.splitlines()[-1] if message else "it printed nothing"
        raise MtpgoError(f"the step {step!r} ended with status {process.returncode}: {last}")
    return StepCost(
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
) -> list[StepCost]:
    """Measure every step, print the table and write it.

    Args:
        data: folder of recordings; None simulates a highway.
        layout: layout of the recordings.
        minutes: length of the simulated recording (min).
        command: command that repeats the measurement.
        output: JSON file, or None.

    Raises:
        MtpgoError: SUMO is missing, the recordings are unusable, or the file cannot be written.
    """
    require_linux()
    print_heading(command, output)
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if data is None:
            data, layout = folder / "recordings", "highd"
            _simulate(minutes, data)
        duration_s, description = _describe(data, layout)
        print(description + "\n")
        name = "mtpgo_training.cli"
        fill = ["-m", "mtpgo_training.benchmark.fill_cache", str(data), layout]
        steps = [
            # Every step includes the start of a command.
            ("start of a command", ["-m", name, "convert", "--help"]),
            ("convert", ["-m", name, "convert", layout, str(data), "-o", str(folder / "bags")]),
            ("cache, first time", [*fill, str(folder / "cache")]),
            ("cache, again", [*fill, str(folder / "cache")]),
        ]
        costs = [timed(step, arguments, duration_s) for step, arguments in steps]
    print(table(costs, _COLUMNS))
    write_json(
        output, {"command": command, "recording_s": duration_s, "rows": [*map(vars, costs)]}
    )
    return costs


def _simulate(minutes: float, folder: Path) -> None:
    """Write a simulated highway of highD's size as uncompressed CSV files, as highD has them."""
    from mtpgo_training.data.writers.highd_writer import write_highd
    from mtpgo_training.simulate.highway import HighwayConfig, simulate_highway

    print(f"simulating {minutes:g} minutes of traffic (not measured)", flush=True)
    recording = simulate_highway(HighwayConfig(seconds=60.0 * minutes, seed=1), "01")
    write_highd(recording, folder, compress=False)


def _describe(data: Path, layout: str) -> tuple[float, str]:
    """Return the total duration of the recordings (s) and a sentence about them."""
    from mtpgo_training.data.readers import load_recordings

    recordings = load_recordings(data, layout)
    duration_s = sum(recording.duration_s for recording in recordings)
    users = sum(len(recording.track_id) for recording in recordings)
    rows = sum(len(recording) for recording in recordings)
    return duration_s, (
        f"{len(recordings)} recording(s): {duration_s:.0f} s, {users} road users, {rows} rows"
    )
