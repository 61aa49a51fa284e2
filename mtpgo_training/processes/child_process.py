# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starts the executables of ``mtpgo_ros`` as child processes, each with a log file."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import TracebackType

from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_core.processes.parent_process import ending_with_this_process

READY_S = 120.0
"""Longest wait for a process to become ready (s). Chosen: on a busy machine a cold
start, which loads torch and ROS, takes long."""

ABORT_S = 5.0
"""Time that a process has to end after an exception (s). Chosen: on an idle machine it needs 0.3 s
or, while a model does not answer, 1.1 s."""

POLL_S = 0.02
"""Time between two checks of a condition (s). Chosen: short against a process start, 1 s."""


class ProcessError(MtpgoError):
    """A child process that ended early, did not become ready or did not end."""


def require_ros(purpose: str = "the demo") -> None:
    """Check that ROS 2 is installed, which starting the node needs.

    Args:
        purpose: what starts the node, for the error message.

    Raises:
        ConfigurationError: it is not installed.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise ConfigurationError(
            f"{purpose} starts the ROS 2 node, but rclpy is not installed for this Python: source "
            "ROS 2 Jazzy, or install this package with its extra `ros`"
        )


def isolated() -> dict[str, str]:
    """Return environment variables that isolate a group of processes from all other ROS nodes."""
    return {
        # Domain IDs up to 101 need no ephemeral ports on any system.
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


class ChildProcess:
    """One executable of ``mtpgo_ros``, run by the same interpreter.

    As a context manager it stops the process at the end, without an error of its own after an
    exception. It also ends when this process is killed.

    Args:
        name: module within ``mtpgo_ros``.
        arguments: its command line.
        log: file for its standard output and standard error.
        environment: variables to set in addition to the inherited ones.
        stop_timeout_s: time it has to end after the stop signal (s).
        cores: cores that it may use, all if empty.

    Attributes:
        name: see above.
        log: see above.
        started_ns: time of its start (ns, monotonic clock).
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
        stop_timeout_s: float = 15.0,
        cores: Collection[int] = (),
    ) -> None:
        self.name = name
        self.log = log
        self._stop_timeout_s = stop_timeout_s
        # The same interpreter: the ROS wheels set an environment variable by which a child with
        # another interpreter would load this interpreter's libraries.
        command = ending_with_this_process([sys.executable, "-m", f"mtpgo_ros.{name}", *arguments])
        log.parent.mkdir(parents=True, exist_ok=True)
        self.started_ns = time.monotonic_ns()
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
                start_new_session=True,
            )
        if cores:
            # Before the interpreter has started, so that all its threads inherit the affinity.
            os.sched_setaffinity(self._process.pid, cores)

    def __enter__(self) -> ChildProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.stop()
        else:
            self.abort()

    @property
    def pid(self) -> int:
        """Process ID."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return self._process.poll() is None

    def text(self) -> str:
        """Return what it has printed so far."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def press_enter(self) -> None:
        """Send a line to its standard input."""
        assert self._process.stdin is not None
        # A process that has ended is reported by the next wait.
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(b"\n")
            self._process.stdin.flush()

    def wait_for(self, word: str, timeout_s: float, times: int = 1) -> None:
        """Wait until it has printed a word.

        Args:
            word: part of its output.
            timeout_s: longest wait (s).
            times: number of occurrences to wait for.

        Raises:
            ProcessError: it ended before, or the time is over.
        """
        wait_until(lambda: self.text().count(word) >= times or not self.running, timeout_s)
        if self.text().count(word) >= times:
            return
        if not self.running:
            raise self._ended_early()
        raise ProcessError(
            f"{self.name} was not ready within {timeout_s:.0f} s, see {self.log} for its output"
        )

    def wait(self, timeout_s: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Wait until it has ended by itself.

        Args:
            timeout_s: longest wait (s).
            meanwhile: called every ``POLL_S``.

        Raises:
            ProcessError: it failed, or the time is over.
        """

        def ended() -> bool:
            meanwhile()
            return not self.running

        if not wait_until(ended, timeout_s):
            raise ProcessError(f"{self.name} did not end within {timeout_s:.0f} s, see {self.log}")
        if self._process.returncode != 0:
            raise self._ended_early()

    def check(self) -> None:
        """Check that it is still running.

        Raises:
            ProcessError: it has ended.
        """
        if not self.running:
            raise self._ended_early()

    def stop(self) -> None:
        """Send the signal of Ctrl-C and wait for the end.

        Raises:
            ProcessError: it failed, or had to be killed.
        """
        if not self._ends(self._stop_timeout_s):
            self._kill()
            raise ProcessError(
                f"{self.name} did not end within {self._stop_timeout_s:.0f} s after SIGINT and "
                f"was killed, see {self.log}"
            )
        if self._process.returncode != 0:
            raise self._ended_early()

    def abort(self) -> None:
        """End it, whatever its status; kill it only if it does not end soon.

        One that is killed leaves its part of shared memory behind.
        """
        try:
            self._ends(ABORT_S)
        finally:  # Ctrl-C may come again.
            self._kill()

    def _ends(self, timeout_s: float) -> bool:
        """Send the signal of Ctrl-C; return whether it has ended within a time (s)."""
        if self.running:
            self._process.send_signal(signal.SIGINT)
        return wait_until(lambda: not self.running, timeout_s)

    def _kill(self) -> None:
        """Kill it if it runs, and wait for the end."""
        if self.running:
            self._process.kill()
        self._process.wait()

    def _ended_early(self) -> ProcessError:
        lines = [line.strip() for line in self.text().splitlines() if line.strip()]
        last = lines[-1] if lines else "it printed nothing"
        return ProcessError(
            f"{self.name} ended with status {self._process.returncode}: {last} (full output in "
            f"{self.log})"
        )


def wait_until(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Wait for a condition; return whether it became true within the timeout (s)."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(POLL_S)
    return True
