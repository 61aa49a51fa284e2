# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node and its companions as processes of their own, each with its log in a file."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import TracebackType

from mtpgo_core.errors import MtpgoError

POLL_S = 0.02
"""How often a condition is looked at (s)."""


class ProcessError(MtpgoError):
    """A child process that ended early, never got ready or would not end."""


def isolated() -> dict[str, str]:
    """Environment of processes that hear nobody else's topics, and whom nobody else hears."""
    return {
        # Domains up to 101 are safe on every system.
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


class Child:
    """One executable of this package, run by the same interpreter.

    Use it as a context: at the end it is told to end and waited for.

    Args:
        name: module within ``mtpgo_ros`` and name of the log.
        arguments: its command line.
        log: file that takes what it prints on both streams.
        environment: variables to set beside the inherited ones.
        patience_s: time it gets to end when told to (s).
        cores: the only ones it may use, where they are named.

    Attributes:
        started_ns: when it was started (ns of the monotonic clock).
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
        patience_s: float = 15.0,
        cores: Collection[int] = (),
    ) -> None:
        self.name = name
        self.log = log
        self._patience_s = patience_s
        # Only the same interpreter may be started: the ROS wheels leave a mark in the environment
        # by which a child of another one would load this one's libraries.
        command = [sys.executable, "-m", f"mtpgo_ros.{name}", *arguments]
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
            # Before the interpreter is up; all its threads will take over the restriction.
            os.sched_setaffinity(self._process.pid, cores)

    def __enter__(self) -> Child:
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
            self.kill()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return self._process.poll() is None

    def text(self) -> str:
        """All that it has printed."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def press_enter(self) -> None:
        """Send a line to its standard input."""
        assert self._process.stdin is not None
        with contextlib.suppress(
            BrokenPipeError
        ):  # it has ended; whoever waits for it will say so
            self._process.stdin.write(b"\n")
            self._process.stdin.flush()

    def wait_for(self, word: str, timeout_s: float, times: int = 1) -> None:
        """Wait until it has printed ``word``, as many ``times``.

        Raises:
            ProcessError: it ended before, or the time is over.
        """
        wait_until(lambda: self.text().count(word) >= times or not self.running, timeout_s)
        if self.text().count(word) >= times:
            return
        if not self.running:
            raise self._ended_early()
        raise ProcessError(
            f"{self.name} was not ready within {timeout_s:.0f} s, see {self.log} for what it said"
        )

    def wait(self, timeout_s: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Wait until it has ended by itself, calling ``meanwhile`` now and then.

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
        """That it is still running.

        Raises:
            ProcessError: it has ended.
        """
        if not self.running:
            raise self._ended_early()

    def stop(self) -> None:
        """Tell it to end, as Ctrl-C would, and wait for that.

        Raises:
            ProcessError: it failed, or had to be killed.
        """
        if self.running:
            self._process.send_signal(signal.SIGINT)
        if not wait_until(lambda: not self.running, self._patience_s):
            self.kill()
            raise ProcessError(
                f"{self.name} did not end within {self._patience_s:.0f} s of being told to and "
                f"was killed, see {self.log}"
            )
        if self._process.returncode != 0:
            raise self._ended_early()

    def kill(self) -> None:
        """End it at once."""
        if self.running:
            self._process.kill()
        self._process.wait()

    def _ended_early(self) -> ProcessError:
        lines = [line.strip() for line in self.text().splitlines() if line.strip()]
        said = lines[-1] if lines else "it said nothing"
        return ProcessError(
            f"{self.name} ended with status {self._process.returncode}: {said} (all of it is in "
            f"{self.log})"
        )


def wait_until(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Whether ``condition`` came true within the time."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(POLL_S)
    return True
