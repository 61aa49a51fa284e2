# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the executables of this package share: their way to end, and the allocator's settings."""

from __future__ import annotations

import argparse
import ctypes
import math
import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

BAD_INPUT = 2
"""Exit status for bad input: a file, an argument or a parameter."""

# From glibc's malloc.h.
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3


def tune_allocator() -> bool:
    """Let glibc keep the memory that a prediction frees for the next one.

    By default glibc hands blocks above a threshold back to the system at once and fetches them
    anew, page by page, in the next cycle: with many agents that costs more than the model itself.
    The price is that the process keeps its peak memory.

    Returns:
        True where the settings were made; false where the C library is not glibc.
    """
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "gnu_get_libc_version"):
        return False
    settings = ((_M_MMAP_THRESHOLD, 1 << 25), (_M_TRIM_THRESHOLD, 1 << 30), (_M_TOP_PAD, 64 << 20))
    return all(libc.mallopt(name, value) == 1 for name, value in settings)


def return_free_memory() -> None:
    """Give the system back what has been freed so far; once, after something costly is over.

    Reading a TorchScript file frees some 80 MB that a node would otherwise hold for good.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):  # glibc's
        libc.malloc_trim(0)


def fail(program: str, error: object) -> int:
    """Print one sentence on stderr and return the exit status of bad input."""
    sentence = " ".join(str(error).split())
    print(f"{program}: {sentence}", file=sys.stderr, flush=True)
    return BAD_INPUT


def leave(status: int) -> NoReturn:
    """End the process at once, whatever its other threads are doing.

    A thread inside the model cannot be interrupted, and the interpreter's own way out would run
    into it. Call this when all files are closed.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def stop_on_signals() -> Callable[[], bool]:
    """Take SIGINT and SIGTERM as the wish to end in order, from now to the end of the process.

    A further one changes nothing: cleaning up must not be torn apart.

    Returns:
        A function that says whether one has come.
    """
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: stopped.append(received))
    return lambda: bool(stopped)


class ArgumentParser(argparse.ArgumentParser):
    """Answers wrong arguments with one line instead of the whole usage."""

    def error(self, message: str) -> NoReturn:
        """Print ``message`` on stderr and end with the exit status of bad input."""
        self.exit(fail(self.prog, f"{message} (see {self.prog} --help)"))


def positive(text: str) -> float:
    """An argument that must be a number above zero."""
    value = _number(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text} given, expected a number above 0")
    return value


def not_negative(text: str) -> float:
    """An argument that must be a number, zero or above."""
    value = _number(text)
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text} given, expected a number of at least 0")
    return value


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} given, expected a finite number")
    return value
