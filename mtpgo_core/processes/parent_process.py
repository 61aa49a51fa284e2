# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Child processes that end when their parent has ended, however it ended.

A parent that is killed cannot end its children, which could run on for hours; the kernel sends
them a signal instead. ``python -m mtpgo_core.processes.parent_process PARENT COMMAND...`` runs any
command in this way.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

_SET_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of linux/prctl.h


def end_with_parent(number: int = signal.SIGTERM, parent: int | None = None) -> None:
    """Receive a signal when the parent process ends; now, if it has ended already.

    Strictly, the signal is sent when the *thread* ends that started this process. Other systems
    than Linux have no such signal, and nothing happens.

    Args:
        number: the signal; a command that this process becomes by ``exec`` receives it, too.
        parent: process ID of the parent, if it is known.
    """
    if not sys.platform.startswith("linux"):
        return
    found = os.getppid()
    ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, number)
    # Process 1 adopts orphans. In a container it may be the parent itself, and then it has started
    # this process in its own session.
    adopted = found == 1 and os.getsid(0) != os.getsid(1)
    ended = adopted if parent is None else found != parent
    if ended or os.getppid() != found:
        os.kill(os.getpid(), number)


def ending_with_this_process(command: Sequence[str | Path]) -> list[str]:
    """Return a command line that runs a command, which receives SIGTERM when this process ends.

    Args:
        command: the program with its arguments.
    """
    return [sys.executable, "-m", __name__, str(os.getpid()), *map(str, command)]


def main(arguments: Sequence[str]) -> None:
    """Become a command that ends with its parent.

    Args:
        arguments: process ID of the parent, the program and its arguments.
    """
    end_with_parent(parent=int(arguments[0]))
    os.execvp(arguments[1], list(arguments[1:]))


if __name__ == "__main__":
    main(sys.argv[1:])
