# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The server that processes are forked from: it imports what they need, once and early."""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing import forkserver, resource_tracker

from mtpgo_training.parallel.dask_settings import ENVIRONMENT
from mtpgo_training.parallel.pool_options import PoolOptions


def start_fork_server(options: PoolOptions, module: str) -> None:
    """Start the server, if processes are wanted on this machine and it does not run yet.

    It imports Dask and a module while this process goes on, so a command calls this before its
    own imports. It ends with this process, but not before it has imported them, so a command
    checks its arguments first.

    Args:
        options: where items are worked on.
        module: the one with the function that is called in the processes.
    """
    if options.here or options.cluster:
        return
    multiprocessing.get_context("forkserver").set_forkserver_preload(["distributed.nanny", module])
    own = {name: os.environ.get(name) for name in ENVIRONMENT}
    resource_tracker.ensure_running()  # here, since its start would unblock the signal
    # Ctrl-C is for this process, which then ends the others.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        os.environ.update(ENVIRONMENT)
        forkserver.ensure_running()
    finally:
        for name, value in own.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
