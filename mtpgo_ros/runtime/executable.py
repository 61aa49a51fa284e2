# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared by the executables: exit status, signals, arguments, and settings of the allocator."""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import importlib.util
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn

from mtpgo_core.completion import complete
from mtpgo_core.versions import add_version, version_text

BAD_INPUT = 2
"""Exit status for bad input: a file, an argument or a parameter."""

ROS_ARGUMENTS = "--ros-args"
"""Begins the arguments of ROS on a command line."""

_received: list[int] = []
"""Signals since :func:`stop_on_signals`."""

_interruptible = False
"""Whether the main thread is in a block of :func:`interruptible`."""

# From glibc's malloc.h.
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -2, -3, -8

# From linux/prctl.h.
_PR_SET_THP_DISABLE = 41


def tune_allocator() -> bool:
    """Make glibc keep the memory that a prediction frees for the next one.

    By default glibc returns blocks above a threshold to the system immediately and requests them
    again, page by page, in the next cycle: with many agents that takes longer than the model. The
    disadvantage is that the process keeps its peak memory.

    Returns:
        Whether the settings were made; false if the C library is not glibc.
    """
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "gnu_get_libc_version"):
        return False
    # Bytes; chosen: blocks up to 32 MB (glibc's maximum) come from the heap, of which 1 GB may be
    # free before it is trimmed, and which grows in steps of 64 MB. One heap for all threads: what
    # one of them frees serves the others, 40 MB less with 64 road users (measured).
    settings = (
        (_M_ARENA_MAX, 1),
        (_M_MMAP_THRESHOLD, 1 << 25),
        (_M_TRIM_THRESHOLD, 1 << 30),
        (_M_TOP_PAD, 64 << 20),
    )
    return all(libc.mallopt(name, value) == 1 for name, value in settings)


def use_small_pages() -> bool:
    """Let Linux give this process no huge pages; call it before memory is used.

    numpy asks for them where an array has 4 MB or more, and with the settings of
    :func:`tune_allocator` these arrays are on the heap, as is all that comes to their place after
    them. Minutes later the kernel replaces 512 pages of 4 kB there by one of 2 MB, also where most
    of them have never been used, so that the resident memory grows in steps that no code explains.

    Returns:
        Whether the setting was made; false if the system has none.
    """
    libc = ctypes.CDLL(None)
    return hasattr(libc, "prctl") and libc.prctl(_PR_SET_THP_DISABLE, 1, 0, 0, 0) == 0


def share_interpreter() -> None:
    """Let threads take turns ten times as often as by default.

    A thread that decodes a large message otherwise keeps the executor waiting 5 ms each time that
    it needs the interpreter, and a service call needs it some ten times.
    """
    sys.setswitchinterval(0.0005)


def return_free_memory() -> None:
    """Return freed memory to the system; call it once after a memory-intensive step.

    Reading a TorchScript file frees some 80 MB (measured) that the process would otherwise keep.
    """
    libc = ctypes.CDLL(None)
    if hasattr(libc, "malloc_trim"):  # glibc's
        libc.malloc_trim(0)


def tell(sentence: str, *, error: bool = False) -> None:
    """Print a line on stdout, or on stderr; the work goes on where that is closed or not read.

    A script may end reading after the line that it waits for.
    """
    stream = sys.stderr if error else sys.stdout
    if stream is None:  # as Python has it where the file is closed
        return
    try:
        print(sentence, file=stream, flush=True)
    except OSError:
        # What waits to be written would fail again at the end of the process.
        with contextlib.suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())


def fail(program: str, error: object) -> int:
    """Print one sentence on stderr and return the exit status of bad input."""
    sentence = " ".join(str(error).split())
    tell(f"{program}: {sentence}", error=True)
    return BAD_INPUT


def leave(status: int) -> NoReturn:
    """End the process immediately, without waiting for its other threads.

    A thread inside the model cannot be interrupted, and the interpreter's normal exit would wait
    for it or crash. Call this after all files are closed.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            if stream is not None:
                stream.flush()
    os._exit(status)


def stop_on_signals() -> Callable[[], bool]:
    """Treat SIGINT and SIGTERM as requests for an orderly end, until the process ends.

    Further signals have no effect, so that cleaning up is not interrupted.

    Returns:
        A function that returns whether a signal was received.
    """
    _received.clear()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _remember)
    return stop_requested


def stop_requested() -> bool:
    """Return whether :func:`stop_on_signals` is in force and a signal came since; any thread."""
    return bool(_received) and signal.getsignal(signal.SIGTERM) is _remember


def _remember(received: int, _frame: object) -> None:
    global _interruptible
    _received.append(received)
    if _interruptible:
        _interruptible = False  # Cleaning up is not interrupted.
        raise Interrupted


class Interrupted(BaseException):
    """A signal came in a block of :func:`interruptible`.

    Like KeyboardInterrupt no Exception, so that what handles errors in the block lets it pass.
    """


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let a signal end the block at once, for steps of the start that take seconds.

    It has no effect in other threads than the main one, nor unless :func:`stop_on_signals` is in
    force. A single call into a C library, such as loading a TorchScript file, ends first.

    Raises:
        Interrupted: a signal came in the block or before.
    """
    global _interruptible
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _interruptible = True
    try:
        if stop_requested():
            raise Interrupted
        yield
        # A library may have taken it for an error of its own, in C or in a bare except.
        if stop_requested():
            raise Interrupted
    except Exception as error:
        if stop_requested():
            raise Interrupted from error
        raise
    finally:
        _interruptible = False


def answered(
    program: str, arguments: Sequence[str], parser: Callable[[], argparse.ArgumentParser]
) -> bool:
    """Answer ``--version`` and a shell that asks for completions; neither needs ROS.

    Args:
        program: name of the executable.
        arguments: of the process; those of ROS are not looked at.
        parser: returns the parser of the program.

    Returns:
        Whether nothing else is to be done.

    Raises:
        SystemExit: something else is to be done, and ROS 2 is not installed.
    """
    complete(parser)
    own = list(arguments)
    if ROS_ARGUMENTS in own:
        own = own[: own.index(ROS_ARGUMENTS)]
    if "--version" in own:
        tell(version_text(program))
        return True
    if importlib.util.find_spec("rclpy") is None:
        sentence = (
            "rclpy is not installed for this Python: source ROS 2 Jazzy, or install this package "
            "with its extra 'ros': pip install 'mtpgo_ros[ros]'"
        )
        raise SystemExit(fail(program, sentence))
    return False


class ArgumentParser(argparse.ArgumentParser):
    """Reports wrong arguments in one line instead of the whole usage; has ``--version``."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        add_version(self)

    def error(self, message: str) -> NoReturn:
        """Print ``message`` on stderr and exit with the status of bad input."""
        self.exit(fail(self.prog, f"{message} (see {self.prog} --help)"))


def add_end_with_parent(parser: argparse.ArgumentParser) -> None:
    """Add ``--end-with-parent``, for whatever is started by something that may be killed."""
    parser.add_argument(
        "--end-with-parent",
        action="store_true",
        help="end when the parent process ends; the launch files set this",
    )


def positive(text: str) -> float:
    """Return a command-line argument that must be a number above zero."""
    value = _number(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text} given, expected a number above 0")
    return value


def not_negative(text: str) -> float:
    """Return a command-line argument that must be a number of at least zero."""
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
