# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processor time and memory of another process, as Linux tells them under /proc."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mtpgo_core.errors import ConfigurationError

_BETWEEN_NS = 100_000_000


@dataclass(frozen=True)
class Usage:
    """What a process had used at a moment.

    Attributes:
        time_ns: the moment (monotonic clock).
        cpu_s: processor time of all its threads (s).
        resident_mb: memory that it holds, shared libraries included (10^6 bytes).
    """

    time_ns: int
    cpu_s: float
    resident_mb: float


def check_proc() -> None:
    """That processes can be watched and bound to a core here.

    Raises:
        ConfigurationError: they cannot.
    """
    if not Path("/proc/self/stat").is_file() or not hasattr(os, "sched_setaffinity"):
        raise ConfigurationError(
            "the benchmark reads /proc and binds processes to a core, which this system does not "
            "offer; expected Linux"
        )


class ProcessWatch:
    """Collects the usage of a process; call :meth:`look` as often as you like.

    Args:
        pid: number of the process.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self.usages: list[Usage] = []

    def look(self) -> None:
        """Note the usage, ten times a second at most."""
        now_ns = time.monotonic_ns()
        if self.usages and now_ns - self.usages[-1].time_ns < _BETWEEN_NS:
            return
        usage = read_usage(self._pid)
        if usage is not None:
            self.usages.append(usage)


def read_usage(pid: int) -> Usage | None:
    """The usage of a process now, None if it has ended."""
    try:
        # The name in parentheses may hold anything; fields count from behind it.
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return None
    ticks = int(fields[11]) + int(fields[12])
    pages = int(fields[21])
    return Usage(
        time_ns=time.monotonic_ns(),
        cpu_s=ticks / os.sysconf("SC_CLK_TCK"),
        resident_mb=pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
    )


def read_peak_mb(pid: int) -> float:
    """The most memory that a process has held since it began (10^6 bytes), 0 if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0.0
    peak = [line.split()[1] for line in lines if line.startswith("VmHWM:")]
    return int(peak[0]) * 1024 / 1e6 if peak else 0.0


def cpu_share(usages: Sequence[Usage], begin_ns: int, end_ns: int) -> float:
    """Processor time per time between two moments, NaN where fewer than two usages lie there."""
    inside = [usage for usage in usages if begin_ns <= usage.time_ns <= end_ns]
    if len(inside) < 2:
        return float("nan")
    first, last = inside[0], inside[-1]
    return (last.cpu_s - first.cpu_s) / ((last.time_ns - first.time_ns) * 1e-9)


def largest_mb(usages: Sequence[Usage]) -> float:
    """The most memory that was seen (10^6 bytes)."""
    return float(np.max([usage.resident_mb for usage in usages], initial=0.0))
