# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How Dask starts processes, and what it does beside the work."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

CONNECT_S = 60.0
"""Time within which processes that run must answer each other (s); chosen: it takes 20 ms, and far
longer where many others share the cores."""

TRIES = 2
"""Tries of an item whose process ends, as when the memory is full; chosen: once may be another's
fault."""

ENVIRONMENT = {
    # As Dask has it, a process returns memory to the system as soon as it is free (64 kB), only to
    # get it back zeroed for the next array: models took half as long again (measured). All threads
    # share one heap, and one core, since there is a process for each.
    "MALLOC_ARENA_MAX": "1",
    "MALLOC_TRIM_THRESHOLD_": str(1 << 30),
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment variables of the processes, which are read when these start."""

_SETTINGS = {
    "distributed.scheduler.allowed-failures": TRIES - 1,
    # Forks of a server without threads that has imported once what all of them need.
    "distributed.worker.multiprocessing-method": "forkserver",
    "distributed.nanny.pre-spawn-environ": ENVIRONMENT,
    # A process that outgrows its share of the memory is ended and its item tried once more.
    # Results are small: there is nothing to move to the disk, and nothing to wait for.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.comm.timeouts.connect": f"{CONNECT_S:g}s",
    # What Dask measures for its dashboard, which is not shown here. Its profiler looks at the
    # stack of each process every 10 ms and took a tenth of the time of small items (measured).
    # Each process, the scheduler and those that watch over processes look every 20 ms whether
    # their loop is slow; together that took 4 % of a core (measured).
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "2s",
    # There are no copies of results to be reduced.
    "distributed.scheduler.active-memory-manager.start": False,
}


@contextlib.contextmanager
def dask_settings() -> Iterator[None]:
    """Let Dask start processes, and treat those that end, as :data:`_SETTINGS` say."""
    # Imported here: without the extra `fleet`, one process does all.
    import dask
    import distributed  # noqa: F401  its own settings must be there before they are replaced

    with dask.config.set(_SETTINGS):
        yield
