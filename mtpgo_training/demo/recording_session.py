# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real thing: predictor, record and replay, each its own process, at real time."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.demo.capture import TOPICS
from mtpgo_training.demo.node_processes import Child, isolated

READY_S = 120.0
"""A cold start on a busy machine loads torch and ROS within this (s)."""

SUBSCRIBERS = 2
"""Who must listen to the objects before the first is played: the predictor and the recorder."""

LAST_ANSWER_S = 0.5
"""What is not answered so long after the last observation counts as missed (s)."""

LAST_REPORT_S = 1.5
"""The node reports its diagnostics once a second; the last report is waited for (s)."""


def check_ros(who: str = "the demo") -> None:
    """That there is a ROS 2 to start the node with.

    Args:
        who: starts it, for the sentence.

    Raises:
        ConfigurationError: there is none.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise ConfigurationError(
            f"{who} starts the ROS 2 node, but rclpy is not installed for this Python: source "
            "ROS 2 Jazzy, or install this package with its extra `ros`"
        )


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
        bags: one bag a recording.
        durations_s: how long each of them is (s).
        recorded: the bag of the predictions, which must not exist yet.
        logs: folder for what the processes print.
        parameters: the node's parameters, each ``name:=value``.

    Raises:
        ProcessError: one of the processes failed.
    """
    environment = isolated()
    options = [x for parameter in parameters for x in ("-p", parameter)]
    arguments = ["--ros-args", *options] if options else []
    with Child("predictor", arguments, logs / "predictor.log", environment) as predictor:
        predictor.wait_for("ready", READY_S)
        writing = ["-o", str(recorded), "--topics", *TOPICS]
        with Child("record", writing, logs / "record.log", environment) as recorder:
            recorder.wait_for("ready", READY_S)
            predictor.wait_for("heard by", READY_S)
            with _Progress(sum(durations_s)) as progress:
                for number, (bag, duration_s) in enumerate(zip(bags, durations_s, strict=True), 1):
                    with _player(bag, logs, environment) as replay:
                        replay.wait_for("paused", READY_S)
                        predictor.wait_for("hearing", READY_S, times=number)
                        replay.press_enter()
                        _watch(replay, duration_s, progress, (predictor, recorder))
            time.sleep(LAST_REPORT_S)


def _player(bag: Path, logs: Path, environment: dict[str, str]) -> Child:
    """``replay`` of one bag, waiting for its start.

    It waits for its subscribers, but discovery may end later on their side; what the best-effort
    subscription of the predictor does not hear by then would be lost. So it starts paused.
    """
    arguments = [str(bag), "--wait-for-subscribers", str(SUBSCRIBERS), "--start-paused"]
    log = logs / f"replay_{bag.stem}.log"
    return Child("replay", [*arguments, "--no-progress"], log, environment)


def _watch(replay: Child, duration_s: float, progress: _Progress, others: Sequence[Child]) -> None:
    """Follow one playing to its end and to the last answer."""

    def meanwhile() -> None:
        progress.advance(duration_s)
        for other in others:
            other.check()

    progress.begin()
    replay.wait(duration_s + READY_S, meanwhile)
    progress.end(duration_s)
    time.sleep(LAST_ANSWER_S)


class _Progress:
    """A bar over the seconds of all recordings."""

    def __init__(self, total_s: float) -> None:
        form = "  {percentage:3.0f} %|{bar}| {n:.0f} of {total:.0f} s{postfix}"
        print(f"  playing {total_s:.0f} s at real time", flush=True)
        self._bar = tqdm(
            total=total_s, bar_format=form, leave=False, disable=not sys.stderr.isatty()
        )
        self._done_s = self._began_s = 0.0

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def begin(self) -> None:
        """A recording begins."""
        self._began_s = time.monotonic()

    def advance(self, duration_s: float) -> None:
        """Show how far the present recording must be by now."""
        self._show(self._done_s + min(duration_s, time.monotonic() - self._began_s))

    def end(self, duration_s: float) -> None:
        """A recording of this length has been played."""
        self._done_s += duration_s
        self._show(self._done_s)

    def _show(self, seconds: float) -> None:
        self._bar.update(seconds - self._bar.n)
