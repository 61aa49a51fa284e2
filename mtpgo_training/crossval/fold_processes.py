# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Folds in processes of their own, some at the same time, ended by one interrupt.

They also end, after a step of their training, when the process that started them is killed.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from mtpgo_core.errors import MtpgoError
from mtpgo_core.processes.parent_process import end_with_parent
from mtpgo_training.atomic_files import only_writer

# This module loads no torch: a new process is ready to be interrupted as soon as it has loaded it.
if TYPE_CHECKING:
    from mtpgo_training.training.interruption import Interruption

POLL_S = 0.2
"""Time between two looks at a requested end (s); chosen."""


class FoldError(MtpgoError):
    """A fold that could not be trained or scored."""


def failures_text(kind: str, failures: Sequence[str], total: int) -> str:
    """Return in a sentence which of so many folds or runs failed."""
    names = ", ".join(failures)
    return f"{len(failures)} of {total} {kind} failed ({names}); the same command tries them again"


class Job(Protocol):
    """What runs in a process; it can be pickled."""

    @property
    def folder(self) -> Path:
        """Folder of its log."""

    def run(self) -> bool:
        """Run it; return whether it is done, False after an interrupt."""


J = TypeVar("J", bound=Job)


@dataclass
class _Started(Generic[J]):
    """A fold in its process.

    Attributes:
        job: the fold.
        process: its process.
        receiver: gets ``ready``, then the outcome: whether it is done, or an error.
        ready: it can be interrupted by a signal.
    """

    job: J
    process: BaseProcess
    receiver: Connection
    ready: bool = False

    def interrupt(self) -> None:
        """Ask it to end; it completes a step of its training first."""
        if self.process.pid is None or not self.process.is_alive():
            return
        if self.ready:
            os.kill(self.process.pid, signal.SIGINT)
        else:
            self.process.kill()


def run_folds(
    jobs: Sequence[J],
    processes: int,
    interruption: Interruption,
    *,
    started: Callable[[J], object] = lambda job: None,
    finished: Callable[[J], object] = lambda job: None,
    failed: Callable[[J, MtpgoError], object] = lambda job, error: None,
) -> None:
    """Run folds until all are done or an end is requested.

    Args:
        jobs: the folds.
        processes: largest number at the same time.
        interruption: asked for a request to end, which is passed on to the processes.
        started: called with a fold when its process is started.
        finished: called with a fold that is done.
        failed: called with a fold and its error; the other folds go on.
    """
    waiting, running = deque(jobs), list[_Started[J]]()
    stopping = False
    try:
        while waiting or running:
            if interruption.requested() and not stopping:
                stopping = True
                waiting.clear()
                for fold in running:
                    fold.interrupt()
            while waiting and len(running) < processes:
                job = waiting.popleft()
                running.append(_start(job))
                started(job)
            for receiver in wait([fold.receiver for fold in running], timeout=POLL_S):
                fold = next(fold for fold in running if fold.receiver is receiver)
                outcome = _received(fold)
                if outcome == "ready":
                    fold.ready = True
                    if stopping:
                        fold.interrupt()
                    continue
                running.remove(fold)
                fold.process.join()
                fold.receiver.close()
                if isinstance(outcome, MtpgoError):
                    failed(fold.job, outcome)
                elif outcome:
                    finished(fold.job)
                elif not stopping:
                    failed(fold.job, _ended(fold))
    finally:
        for fold in running:
            fold.process.kill()
            fold.process.join()


def _start(job: J) -> _Started[J]:
    """Start the process of a fold."""
    # A forked process may hang on locks that torch's threads held, which it does not have.
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_fold_process, args=(pickle.dumps(job), job.folder, sender))
    process.start()
    sender.close()  # so that the end of the process ends the pipe
    return _Started(job, process, receiver)


def _received(fold: _Started[J]) -> object:
    """Return what the process of a fold sent, None if it ended without sending anything."""
    try:
        return fold.receiver.recv()
    except EOFError:
        return None


def _ended(fold: _Started[J]) -> FoldError:
    log = fold.job.folder / "fold.log"
    return FoldError(f"the process ended with status {fold.process.exitcode}, see {log}")


def _fold_process(job: bytes, folder: Path, sender: Connection) -> None:
    """Run a fold; what it prints is in its log.

    Args:
        job: the pickled fold, which needs modules that take seconds to load.
        folder: its folder.
        sender: see :class:`_Started`.
    """
    os.setsid()  # Ctrl-C reaches the parent process only, which passes it on once
    _redirect(folder / "fold.log")
    outcome: object = None
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        parent = multiprocessing.parent_process()
        end_with_parent(signal.SIGINT, None if parent is None else parent.pid)
        sender.send("ready")
        with only_writer(folder):
            outcome = pickle.loads(job).run()
    except KeyboardInterrupt:
        outcome = False
    except MtpgoError as error:
        outcome = error
    with contextlib.suppress(BrokenPipeError):  # the parent process was killed
        sender.send(outcome)
    sender.close()


def _redirect(log: Path) -> None:
    """Append standard output and error to a file."""
    log.parent.mkdir(parents=True, exist_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    with log.open("a", encoding="utf-8") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
