# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The runs of a study, and their progress: a bar, lines, and an estimate of the time left."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

from tqdm import tqdm

from mtpgo_core.errors import MtpgoError
from mtpgo_training.crossval.fold_processes import Job, run_folds
from mtpgo_training.study.study_run import RunFiles
from mtpgo_training.training.interruption import Interruption

Json = dict[str, Any]


class NamedJob(Job, Protocol):
    """A run that has a name."""

    @property
    def name(self) -> str:
        """Its name."""


class StudyProgress(AbstractContextManager["StudyProgress"]):
    """Shows how far a study is.

    Args:
        runs: of the study.
        done: runs that are done before.
        at_once: runs at the same time.
        quiet: print errors only.

    Attributes:
        last_error: what failed last.
    """

    def __init__(self, runs: int, done: int, at_once: int, *, quiet: bool) -> None:
        self._runs, self._done, self._before = runs, done, done
        self._at_once, self._quiet = at_once, quiet
        self._start = time.monotonic()
        self._bar = tqdm(
            total=runs,
            initial=done,
            unit="run",
            disable=quiet or not sys.stderr.isatty(),
        )
        self.last_error = ""
        self._say(f"{runs} runs, {done} done before, {at_once} at the same time")

    def __exit__(self, *exception: object) -> None:
        """Close the bar."""
        self._bar.close()

    @property
    def minutes_left(self) -> float:
        """Estimate by the mean of the runs of this call (min), NaN before the first is done."""
        ended = self._done - self._before
        if not ended:
            return float("nan")
        elapsed = (time.monotonic() - self._start) / 60.0
        return elapsed / ended * (self._runs - self._done)

    def started(self, name: str, folder: Path) -> None:
        """Say that a run is started."""
        self._say(f"{name}: started, see {RunFiles(folder).log}")

    def finished(self, name: str, scores: Json) -> None:
        """Say how a run went, and how long the others will take."""
        self._count()
        values, training = scores["values"], scores["training"]
        own, cv = values["model"].get("ade"), values.get("cv", {}).get("ade")
        result = "nothing scored" if own is None else f"ADE {own:.3f} m"
        if own is not None and cv is not None:
            result += f" (CV {cv:.3f})"
        self._say(
            f"{name}: {result}, {training['minutes']:.1f} min; {self._done} of {self._runs} runs, "
            f"about {self.minutes_left:.0f} min left"
        )

    def failed(self, name: str, error: str, *, count: bool = True) -> None:
        """Say that a run failed; it is a gap of the table.

        Args:
            name: of the run.
            error: why.
            count: it is one of the runs, not a row that has none.
        """
        self.last_error = error
        if count:
            self._count()
        tqdm.write(f"mtpgo: {name}: {error}", file=sys.stderr)

    def _count(self) -> None:
        self._done += 1
        self._bar.update()

    def _say(self, text: str) -> None:
        if not self._quiet:
            tqdm.write(text)
            sys.stdout.flush()


def run_all(
    jobs: Sequence[NamedJob],
    processes: int,
    progress: StudyProgress,
    write: Callable[[], object],
) -> tuple[int | None, list[str]]:
    """Run trainings in processes of their own; one that fails does not end the others.

    Args:
        jobs: those that are not done.
        processes: largest number at the same time.
        progress: is told of each.
        write: writes the results so far; called after each.

    Returns:
        The signal that ended it, None if none did, and the names of those that failed.
    """
    failures: list[str] = []

    def finished(job: NamedJob) -> None:
        write()
        progress.finished(job.name, RunFiles(job.folder).result() or {})

    def failed(job: NamedJob, error: MtpgoError) -> None:
        RunFiles(job.folder).write_error(error)
        failures.append(job.name)
        write()
        progress.failed(job.name, str(error))

    with progress, Interruption() as interruption:
        run_folds(
            jobs,
            processes,
            interruption,
            started=lambda job: progress.started(job.name, job.folder),
            finished=finished,
            failed=failed,
        )
    return interruption.received_signal, failures
