# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plays bags through the real node: predictor, record and replay as three processes."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from mtpgo_training.demo.recorded_messages import TOPICS
from mtpgo_training.processes.child_process import READY_S, ChildProcess, isolated

SUBSCRIBERS = 2
"""Subscribers of the objects before the first is played: the predictor and the recorder."""

LAST_ANSWER_S = 0.5
"""Wait after the last observation (s); a later prediction counts as missed. Chosen: more than two
periods of 0.2 s."""

FIRST_PREDICTION = "first prediction"
"""Begin of the line by which the predictor reports its first prediction with a road user."""

_HEARS = "hearing"
"""In the line by which the predictor reports a publisher of objects that it can hear."""

_WARNING = re.compile(r"^\[WARN\] \[[^]]*\] \[[^]]*\]: (.*)$", re.MULTILINE)
"""A warning in the log of a node; its sentence is the group."""

LAST_REPORT_S = 1.5
"""Wait for the last diagnostics (s): the node publishes them once a second."""


def run_session(
    bags: Sequence[Path],
    durations_s: Sequence[float],
    *,
    recorded: Path,
    logs: Path,
    parameters: Sequence[str],
) -> None:
    """Play the bags through one predictor and record what it publishes.

    Args:
        bags: one bag per recording.
        durations_s: duration of each bag (s).
        recorded: bag to write the predictions to, which must not exist yet.
        logs: folder for the output of the processes.
        parameters: parameters of the node, each ``name:=value``.

    Raises:
        ProcessError: one of the processes failed.
    """
    environment = isolated()
    options = [x for parameter in parameters for x in ("-p", parameter)]
    arguments = ["--ros-args", *options] if options else []
    with ChildProcess("predictor", arguments, logs / "predictor.log", environment) as predictor:
        predictor.wait_for("ready", READY_S)
        for sentence in warnings_of(predictor.text()):
            print(f"  predictor: {sentence}", flush=True)
        writing = ["-o", str(recorded), "--topics", *TOPICS]
        with ChildProcess("record", writing, logs / "record.log", environment) as recorder:
            recorder.wait_for("ready", READY_S)
            predictor.wait_for("heard by", READY_S)
            with _Progress(sum(durations_s)) as progress:
                for bag, duration_s in zip(bags, durations_s, strict=True):
                    heard = predictor.text().count(_HEARS)  # it may subscribe anew meanwhile
                    with _player(bag, logs, environment) as replay:
                        replay.wait_for("paused", READY_S)
                        predictor.wait_for(_HEARS, READY_S, times=heard + 1)
                        replay.press_enter()
                        _watch(replay, duration_s, progress, (predictor, recorder))
            time.sleep(LAST_REPORT_S)


def warnings_of(log: str) -> list[str]:
    """Return the sentences of the warnings in the log of a node, each once."""
    found = _WARNING.findall(log)
    return list(dict.fromkeys(sentence.strip() for sentence in found))


def _player(bag: Path, logs: Path, environment: dict[str, str]) -> ChildProcess:
    """Start ``replay`` of one bag, paused before the first message.

    ``replay`` waits for its subscribers, but discovery may complete later on their side, and the
    best-effort subscription of the predictor would lose the messages until then.
    """
    arguments = [str(bag), "--wait-for-subscribers", str(SUBSCRIBERS), "--start-paused"]
    log = logs / f"replay_{bag.stem}.log"
    return ChildProcess("replay", [*arguments, "--no-progress"], log, environment)


def _watch(
    replay: ChildProcess, duration_s: float, progress: _Progress, others: Sequence[ChildProcess]
) -> None:
    """Wait for the end of one playback and for the last prediction."""

    def meanwhile() -> None:
        progress.advance(duration_s)
        progress.announce(others[0])
        for other in others:
            other.check()

    progress.begin()
    replay.wait(duration_s + READY_S, meanwhile)
    progress.end(duration_s)
    time.sleep(LAST_ANSWER_S)


class _Progress:
    """A progress bar over the seconds of all recordings."""

    def __init__(self, total_s: float) -> None:
        form = "  {percentage:3.0f} %|{bar}| {n:.0f} of {total:.0f} s{postfix}"
        print(f"  playing {total_s:.0f} s at real time", flush=True)
        self._bar = tqdm(
            total=total_s, bar_format=form, leave=False, disable=not sys.stderr.isatty()
        )
        self._done_s = self._began_s = 0.0
        self._announced = False

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def begin(self) -> None:
        """Mark the start of a recording."""
        self._began_s = time.monotonic()

    def announce(self, predictor: ChildProcess) -> None:
        """Print the predictor's line about its first prediction, as soon as there is one."""
        if self._announced:
            return
        _, found, rest = predictor.text().partition(FIRST_PREDICTION)
        line, ended, _ = rest.partition("\n")
        if found and ended:
            self._announced = True
            self._bar.write(
                f"  {found}{line.rstrip()}, {_since_start_s(predictor):.1f} s after the start"
            )
            sys.stdout.flush()

    def advance(self, duration_s: float) -> None:
        """Show the time since the start of the current recording, at most its duration (s)."""
        self._show(self._done_s + min(duration_s, time.monotonic() - self._began_s))

    def end(self, duration_s: float) -> None:
        """Mark the end of a recording of some duration (s)."""
        self._done_s += duration_s
        self._show(self._done_s)

    def _show(self, seconds: float) -> None:
        self._bar.update(seconds - self._bar.n)


def _since_start_s(process: ChildProcess) -> float:
    """Return the time since a process was started (s)."""
    return (time.monotonic_ns() - process.started_ns) * 1e-9
