# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A trial run of a model file in a process of its own, which can be ended.

A model can compute forever or ask for any amount of memory, and torch can crash on a damaged
file. Nothing in this process could stop that: the interpreter of TorchScript runs without looking
at signals or at the clock, and a thread cannot be ended from outside. So a file that is not one of
the package's own is loaded and run in another process first. The kernel ends that process at its
limit of processor time or memory, this process ends it at a signal or after two minutes. What
passes is loaded here from the same bytes.

The process waits for the next file for some seconds, then it is ended; it ends with this process,
too. A file that passed is not tried a second time.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from mtpgo_core.errors import ModelFileError
from mtpgo_core.task.checked_archive import CheckedArchive

WORKER = "mtpgo_core.prediction.trial_worker"
"""Module that the other process runs."""

PROCESSOR_TIME_S = 10
"""Most processor time of a trial (s); chosen: the largest shipped model needs 0.6 s (measured on a
desktop core), a small embedded core ten times that."""

WALL_TIME_S = 120.0
"""Most time of a trial (s), which a busy machine needs; chosen."""

MEMORY_MB = 2048
"""Most memory that loading and running a model may add (MB); chosen: the shipped one adds 150."""

IDLE_S = 10.0
"""How long the process waits for the next file (s); chosen: it takes as much memory as torch."""

_POLL_S = 0.1
"""How often a request to stop is looked for (s)."""

_passed: set[str] = set()
_worker: subprocess.Popen[bytes] | None = None
_idle: threading.Timer | None = None
_one_at_a_time = threading.RLock()


def start_trials() -> None:
    """Start the process if there is none, without waiting: importing torch takes seconds."""
    global _worker
    with _one_at_a_time:
        if _worker is not None and _worker.poll() is None:
            _end_when_idle()
            return
        end_trials()
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
            "OMP_NUM_THREADS": "1",
            "CUDA_VISIBLE_DEVICES": "",
        }
        _worker = subprocess.Popen(
            [sys.executable, "-P", "-m", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,  # Ctrl-C is for this process, which then ends the other
        )
        _end_when_idle()


def end_trials() -> None:
    """End the process, if there is one."""
    global _worker
    with _one_at_a_time:
        _stay()
        worker, _worker = _worker, None
        if worker is None:
            return
        worker.kill()
        worker.wait()
        for pipe in (worker.stdin, worker.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


def _end_when_idle() -> None:
    """End the process later, unless another file comes."""
    global _idle
    _stay()
    _idle = threading.Timer(IDLE_S, end_trials)
    _idle.daemon = True
    _idle.start()


def _stay() -> None:
    """Take back :func:`_end_when_idle`."""
    global _idle
    if _idle is not None:
        _idle.cancel()
        _idle = None


def try_out(archive: CheckedArchive, stopped: Callable[[], bool] | None = None) -> None:
    """Load and run a model file in another process.

    Args:
        archive: the file, see :func:`mtpgo_core.task.model_file.read_model`.
        stopped: whether this process shall end; asked ten times a second.

    Raises:
        ModelFileError: the file cannot be loaded or run, or not within the limits, or ``stopped``
            was true.
    """
    with _one_at_a_time:
        if archive.sha256 in _passed:
            return
        start_trials()
        _stay()
        try:
            reason = _answer(archive.data, archive.path, stopped or (lambda: False))
            _end_when_idle()
        except BaseException:  # also a KeyboardInterrupt: the process would answer too late
            end_trials()
            raise
    if reason:
        raise ModelFileError(f"model file {archive.path} {reason}")
    _passed.add(archive.sha256)


def _answer(data: bytes, path: Path, stopped: Callable[[], bool]) -> str:
    """Return what is wrong with a file, empty if nothing is."""
    worker = _worker
    assert worker is not None
    assert worker.stdin is not None
    assert worker.stdout is not None
    head = json.dumps({"size": len(data), "path": str(path), "seconds": PROCESSOR_TIME_S,
                       "megabytes": MEMORY_MB})  # fmt: skip
    waiting = memoryview(head.encode() + b"\n" + data)
    os.set_blocking(worker.stdin.fileno(), False)
    end, answer = time.monotonic() + WALL_TIME_S, b""
    with selectors.DefaultSelector() as ready:
        ready.register(worker.stdin, selectors.EVENT_WRITE)
        ready.register(worker.stdout, selectors.EVENT_READ)
        while not answer.endswith(b"\n"):
            if stopped():
                raise ModelFileError(f"model file {path}: loading was interrupted")
            if time.monotonic() > end:
                raise ModelFileError(
                    f"model file {path} does not answer within {WALL_TIME_S:g} s, expected a"
                    " model that computes standing agents in a fraction of a second"
                )
            for key, _ in ready.select(_POLL_S):
                if key.fileobj is worker.stdin:
                    try:
                        waiting = waiting[os.write(worker.stdin.fileno(), waiting[: 1 << 16]) :]
                    except BlockingIOError:
                        continue
                    except BrokenPipeError:
                        ready.unregister(worker.stdin)
                        continue
                    if not waiting:
                        ready.unregister(worker.stdin)
                else:
                    part = os.read(worker.stdout.fileno(), 1 << 16)
                    if not part:
                        raise ModelFileError(f"model file {path} {_end_of(worker)}")
                    answer += part
    return str(json.loads(answer))


def _end_of(worker: subprocess.Popen[bytes]) -> str:
    """Return why the process ended, as the end of a sentence."""
    status = worker.wait()
    if status == -signal.SIGXCPU:
        return (
            f"computes for more than {PROCESSOR_TIME_S} s of processor time, expected a model"
            " that computes standing agents in a fraction of a second"
        )
    if status < 0:
        return (
            f"ended the process that tried it ({signal.Signals(-status).name}), expected a file"
            " that torch can load and run"
        )
    return f"could not be tried: the process for it ended with status {status}"
