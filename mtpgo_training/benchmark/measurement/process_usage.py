# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processor time and memory of another process, sampled while it runs."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError

SAMPLE_PERIOD_S = 0.1
"""Least time between two samples (s). Chosen: 600 samples in a measurement of 60 s."""


@dataclass(frozen=True)
class Usage:
    """Resources that a process had used at one time.

    Attributes:
        time_ns: time of the sample (ns, monotonic clock).
        cpu_s: processor time of all threads since the process started (s).
        resident_mb: resident memory, shared libraries included (10^6 bytes).
    """

    time_ns: int
    cpu_s: float
    resident_mb: float


def require_linux() -> None:
    """Check that this system can bind processes to a core and report their peak memory.

    Raises:
        ConfigurationError: it cannot.
    """
    if not Path("/proc/self/status").is_file() or not hasattr(os, "sched_setaffinity"):
        raise ConfigurationError(
            "the benchmark reads /proc and binds processes to a core, which this system does not "
            "offer; expected Linux"
        )


class ProcessMonitor:
    """Samples the usage of a process each time :meth:`sample` is called.

    Args:
        pid: process ID.

    Attributes:
        usages: the samples, in order of time.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self.usages: list[Usage] = []

    def sample(self) -> None:
        """Record the usage, unless the last sample is younger than ``SAMPLE_PERIOD_S``."""
        if self.usages and time.monotonic_ns() < self.usages[-1].time_ns + 1e9 * SAMPLE_PERIOD_S:
            return
        usage = read_usage(self._pid)
        if usage is not None:
            self.usages.append(usage)


def read_usage(pid: int) -> Usage | None:
    """Return the current usage of a process, None if it has ended."""
    import psutil  # only here: `mtpgo benchmark --help` works without the extra `training`

    try:
        process = psutil.Process(pid)
        with process.oneshot():
            cpu, memory = process.cpu_times(), process.memory_info()
    except psutil.NoSuchProcess:
        return None
    return Usage(time.monotonic_ns(), cpu.user + cpu.system, memory.rss / 1e6)


def read_peak_mb(pid: int) -> float:
    """Return the peak resident memory of a process (10^6 bytes), 0 if it has ended."""
    # From /proc, since psutil reports the peak on Windows only.
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0.0
    peak_kib = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    return peak_kib[0] * 1024 / 1e6 if peak_kib else 0.0


def cpu_share(usages: Sequence[Usage], begin_ns: int, end_ns: int) -> float:
    """Return processor time per elapsed time between two times, 1 for one whole core.

    Args:
        usages: samples, in order of time.
        begin_ns: start of the interval (ns, monotonic clock).
        end_ns: end of the interval (ns, monotonic clock).

    Returns:
        The share; NaN if fewer than two samples are in the interval.
    """
    inside = [usage for usage in usages if begin_ns <= usage.time_ns <= end_ns]
    if len(inside) < 2:
        return float("nan")
    first, last = inside[0], inside[-1]
    return (last.cpu_s - first.cpu_s) / ((last.time_ns - first.time_ns) * 1e-9)


def largest_mb(usages: Sequence[Usage]) -> float:
    """Return the largest resident memory among the samples (10^6 bytes), 0 without samples."""
    return max((usage.resident_mb for usage in usages), default=0.0)
