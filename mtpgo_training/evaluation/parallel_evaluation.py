# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation in several processes, each with one recording at a time; same results as in one."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.evaluator import Evaluation, Settings, evaluate_all
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes

_runners: dict[str, ModelRunner] = {}
"""Models of a worker process, loaded when it starts."""


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
    # A forked torch may hang on the locks of threads that it lacks.
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
    """Load the models; leave interrupts to the parent process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _runners.update({name: ModelRunner.load(path) for name, path in models.items()})


def _one(name: str, recording: Recording, settings: Settings, draw: Sequence[str]) -> Evaluation:
    return evaluate_all(_runners, [(name, recording)], settings, draw=draw)
