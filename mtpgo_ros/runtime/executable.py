# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared by the executables: exit status, signals and arguments."""

from __future__ import annotations

import argparse
import contextlib
import gc
import importlib.util
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn, TextIO

from mtpgo_core.completion import complete
from mtpgo_core.errors import reason_of
from mtpgo_core.versions import add_version, version_text

BAD_INPUT = 2
"""Exit status for bad input: a file, an argument or a parameter."""

OUTPUT_CLOSED = 141
"""Exit status where the reader of the output has ended, as for a process that SIGPIPE ends."""

ROS_ARGUMENTS = "--ros-args"
"""Begins the arguments of ROS on a command line."""

_received: list[int] = []
"""Signals since :func:`stop_on_signals`."""

_interruptible = False
"""Whether the main thread is in a block of :func:`interruptible`."""


def share_interpreter() -> None:
    """Let threads take turns ten times as often as by default.

    A thread that decodes a large message otherwise keeps the executor waiting 5 ms each time that
    it needs the interpreter, and a service call needs it some ten times.
    """
    sys.setswitchinterval(0.0005)


def tell(sentence: str, *, error: bool = False) -> None:
    """Print a line on stdout or stderr; errors are ignored, for example of a closed pipe.

    A script may stop reading after the line that it waits for.
    """
    stream = sys.stderr if error else sys.stdout
    if stream is None:  # as Python has it where the file is closed
        return
    try:
        print(sentence, file=stream, flush=True)
    except OSError:
        _drop_output(stream)


def answer(program: str, text: str) -> None:
    """Print requested text, such as the help, on stdout; print nothing if that is closed.

    Raises:
        SystemExit: it cannot be written, as on a full disk, or its reader has ended.
    """
    if sys.stdout is None:
        return
    try:
        print(text, end="", flush=True)
    except OSError as error:
        _drop_output(sys.stdout)
        if isinstance(error, BrokenPipeError):
            raise SystemExit(OUTPUT_CLOSED) from error
        raise SystemExit(fail(program, reason_of(error))) from error


def _drop_output(stream: TextIO) -> None:
    """Redirect the rest of the output to the null device: flushing it at exit would fail again."""
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


def run_as_process(main: Callable[[], int | None]) -> NoReturn:
    """Run an executable and end the process with its status, whatever signals come meanwhile.

    A process that ends without having left the domain is one that crashed to Fast DDS: its port in
    shared memory stays, and the others write there, for a second at least, what the next process
    of that port waits for. rclpy leaves the domain when the last node is destroyed; of one that
    could not be made completely, when Python frees it, which may be in reference cycles.

    Args:
        main: of the executable; destroys its nodes and returns the exit status, None for 0.
    """
    status = main() or 0
    gc.collect()
    leave(status)


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
        SystemExit: something else is to be done, and ROS 2 is not installed; or the answer cannot
            be written.
    """
    complete(parser)
    own = list(arguments)
    if ROS_ARGUMENTS in own:
        own = own[: own.index(ROS_ARGUMENTS)]
    if "--version" in own:
        answer(program, version_text(program) + "\n")
        return True
    if importlib.util.find_spec("rclpy") is None:
        sentence = (
            "rclpy is not installed for this Python: source ROS 2 Jazzy, or install this package "
            "with its extra 'ros': pip install 'mtpgo_ros[ros]'"
        )
        raise SystemExit(fail(program, sentence))
    return False


class ArgumentParser(argparse.ArgumentParser):
    """Reports wrong arguments in one line instead of the whole usage; has ``--version``.

    Args:
        args: of the parser of the standard library, like ``options``.
        parameters: the program is a node whose settings are parameters of ROS, so that whatever
            it does not know may be meant as one.
        options: see ``args``.
    """

    def __init__(self, *args: Any, parameters: bool = False, **options: Any) -> None:
        super().__init__(*args, **options)
        self._parameters = parameters
        add_version(self)

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print the help or an error; argparse drops what cannot be written."""
        if file is sys.stdout:
            answer(self.prog, message)
        elif message:
            tell(message.rstrip("\n"), error=True)

    def error(self, message: str) -> NoReturn:
        """Print ``message`` on stderr and exit with the status of bad input."""
        hint = self._parameter_hint(message)
        self.exit(fail(self.prog, f"{message}{hint} (see {self.prog} --help)"))

    def _parameter_hint(self, message: str) -> str:
        """Return how parameters are given, empty unless some may be among unknown arguments."""
        unknown = message.removeprefix("unrecognized arguments: ")
        given = next((word for word in unknown.split() if ":=" in word), None)
        if unknown == message or (given is None and not self._parameters):
            return ""
        example = f"{self.prog} {ROS_ARGUMENTS} -p {given or 'NAME:=VALUE'}"
        return f", parameters follow {ROS_ARGUMENTS}: {example}"


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
