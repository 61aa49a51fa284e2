# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation with progress bars, in one process or in several with the same results."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

from tqdm import tqdm

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.evaluator import Evaluation, Settings, evaluate_all
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes

_runners: dict[str, ModelRunner] = {}
"""Models of a worker process, loaded when it starts."""


def evaluate_recordings(
    runners: Mapping[str, ModelRunner],
    recordings: Iterable[tuple[str, Recording]],
    settings: Settings,
    *,
    jobs: int = 1,
    draw: Sequence[str] = (),
    progress: bool = False,
) -> Evaluation:
    """Evaluate models on recordings.

    Args:
        runners: models by name.
        recordings: names and recordings, taken one after the other.
        settings: see :class:`Settings`.
        jobs: number of processes, each with a recording.
        draw: models whose best and worst scenes are kept for a picture.
        progress: show progress bars.
    """
    if jobs > 1:
        files = {name: runner.path for name, runner in runners.items()}
        with tqdm(desc="evaluating", unit="recording", disable=not progress, leave=False) as whole:
            return evaluate_in_processes(
                files, recordings, settings, jobs, draw=draw, done=lambda _: whole.update()
            )
    bars: list[tqdm] = []

    def start_bar(name: str, frames: int) -> Callable[[], object]:
        for bar in bars:
            bar.close()
        bars[:] = [tqdm(total=frames, desc=name, unit="frame", disable=not progress, leave=False)]
        return bars[0].update

    try:
        return evaluate_all(runners, recordings, settings, draw=draw, progress=start_bar)
    finally:
        for bar in bars:
            bar.close()


def evaluate_in_processes(
    models: Mapping[str, Path],
    recordings: Iterable[tuple[str, Recording]],
    settings: Settings,
    jobs: int,
    *,
    draw: Sequence[str] = (),
    done: Callable[[str], object] = lambda name: None,
) -> Evaluation:
    """Evaluate as :func:`evaluate_all` does, with one torch thread in each process.

    Args:
        models: files by name.
        recordings: names and recordings, taken one after the other as processes become free.
        settings: see :class:`Settings`.
        jobs: number of processes.
        draw: models whose best and worst scenes are kept for a picture.
        done: called with the name of each recording that is done.
    """
    result = Evaluation(scenes={name: ExtremeScenes() for name in draw})
    # A forked process may hang on locks that torch's threads held, which it does not have.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _start, (dict(models),)) as pool:
        waiting: deque[tuple[str, Future[Evaluation]]] = deque()

        def take() -> None:
            name, future = waiting.popleft()
            result.merge(future.result())
            done(name)

        try:
            for name, recording in recordings:
                waiting.append((name, pool.submit(_one, name, recording, settings, tuple(draw))))
                if len(waiting) > 2 * jobs:
                    take()
            while waiting:
                take()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return result


def _start(models: dict[str, Path]) -> None:
    """Load the models, which the parent process has tried; leave interrupts to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _runners.update({name: ModelRunner.load(path, trusted=True) for name, path in models.items()})


def _one(name: str, recording: Recording, settings: Settings, draw: Sequence[str]) -> Evaluation:
    return evaluate_all(_runners, [(name, recording)], settings, draw=draw)
