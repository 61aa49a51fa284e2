# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the offline half's tests: number of threads, a cache folder, no forks."""

import os
import sys
import traceback
from pathlib import Path

import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))

_forks = []
os.register_at_fork(before=lambda: _forks.append("".join(traceback.format_stack(limit=12))))


@pytest.fixture(autouse=True)
def no_fork():
    """No process is started by a fork, which may deadlock: torch has threads in this process.

    Starting another program does not count: no Python code runs between its fork and its exec.
    """
    _forks.clear()
    yield
    assert not _forks, f"a process was forked, expected spawn:\n{_forks[0]}"


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """No test reads or fills the user's cache."""
    patch = pytest.MonkeyPatch()
    patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()


@pytest.fixture(autouse=True)
def fixed_threads():
    """The same numbers on any machine, and little load on a busy one."""
    before = torch.get_num_threads()
    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    yield
    torch.set_num_threads(before)
