# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A killed process takes along those that it started; orphans are recognised."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mtpgo_core.processes import parent_process
from mtpgo_core.processes.parent_process import end_with_parent

PARENT = """
import subprocess, sys, time
from mtpgo_core.processes.parent_process import ending_with_this_process
command = [sys.executable, "-c", "print('begun', flush=True); import time; time.sleep(600)"]
child = subprocess.Popen(ending_with_this_process(command), start_new_session=True)
print(child.pid, flush=True)
time.sleep(600)
"""

PATIENCE_S = 300.0
"""Longest wait for the end of a process (s); chosen: a busy machine's."""


def has_ended(number):
    """Whether a process is gone, or its status has not been asked for yet."""
    try:
        status = Path(f"/proc/{number}/stat").read_text()
    except FileNotFoundError:
        return True
    return status.rpartition(")")[2].split()[0] == "Z"


def test_the_child_of_a_killed_process_ends():
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True
    ) as parent:
        child = int(parent.stdout.readline())
        assert parent.stdout.readline() == "begun\n"
        assert not has_ended(child)
        parent.kill()
    until_s = time.monotonic() + PATIENCE_S
    while not has_ended(child) and time.monotonic() < until_s:
        time.sleep(0.02)
    assert has_ended(child)


@pytest.mark.parametrize(
    ("parent", "given", "own_session", "ended"),
    [
        (40, None, 7, False),
        (1, None, 7, True),  # adopted by init
        (1, None, 1, False),  # of the first process of a container, as `ros2 launch` is there
        (1, 1, 7, False),  # the same, in a session of its own
        (1, 40, 1, True),
        (40, 40, 7, False),
    ],
)
def test_a_parent_that_has_ended_before_is_noticed(monkeypatch, parent, given, own_session, ended):
    sent = []
    monkeypatch.setattr(os, "getppid", lambda: parent)
    monkeypatch.setattr(os, "getsid", lambda number: 1 if number == 1 else own_session)
    monkeypatch.setattr(os, "kill", lambda number, which: sent.append(which))
    monkeypatch.setattr(parent_process.ctypes, "CDLL", lambda name: Kernel())
    end_with_parent(signal.SIGINT, given)
    assert sent == [signal.SIGINT] * ended


class Kernel:
    """Takes the request of this process without acting on it."""

    def prctl(self, what, number):
        assert (what, number) == (1, signal.SIGINT)
