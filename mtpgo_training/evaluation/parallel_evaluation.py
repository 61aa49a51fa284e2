# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation of many recordings, in one process or in several with the same results."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.data.data_sources import KnownContents, SourceJob, site_of
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.evaluation.evaluator import Evaluation, Settings, evaluate_all
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes
from mtpgo_training.evaluation.honesty.honesty_table import HonestyTable
from mtpgo_training.evaluation.scores.score_table import GroupSums, ScoreTable
from mtpgo_training.parallel.kept_results import kept_or_made
from mtpgo_training.parallel.pool_options import HERE, PoolOptions
from mtpgo_training.parallel.work_item import Failure
from mtpgo_training.parallel.work_pool import work_through


def evaluate_sources(
    runners: Mapping[str, ModelRunner],
    jobs: Sequence[SourceJob],
    settings: Settings,
    *,
    pool: PoolOptions = HERE,
    cache: RecordingCache | None = None,
    resume: Path | None = None,
    draw: Sequence[str] = (),
    progress: bool = False,
) -> tuple[Evaluation, list[Failure]]:
    """Evaluate models on recordings; return the results, and what could not be read or scored.

    Args:
        runners: models by name.
        jobs: the files of the recordings.
        settings: see :class:`Settings`.
        pool: where they are read and scored, with one torch thread in each process.
        cache: cache of recordings that were read before.
        resume: folder that keeps the results of each job, None keeps none.
        draw: models whose best and worst scenes are kept for a picture.
        progress: show progress bars.

    Raises:
        ConfigurationError: two recordings have the same name, or scenes are to be kept.
    """
    if resume is not None and draw:
        raise ConfigurationError("the scenes of a picture cannot be kept for --resume")
    files = tuple((name, r.path.resolve(), r.sha256) for name, r in runners.items())
    if pool.here:
        _loaded[files] = dict(runners)
    scoring = _Scoring(files, settings, cache, resume, tuple(draw), progress and pool.here)
    result = Evaluation(scenes={name: ExtremeScenes() for name in draw})
    failures = []
    contents = KnownContents()
    bar = tqdm(total=len(jobs), desc="evaluating", unit="file", disable=not progress, leave=False)
    with bar:
        for found in work_through(scoring, jobs, pool):
            bar.update()
            if isinstance(found, Failure):
                failures.append(found)
                continue
            again = result.recordings.keys() & found.recordings.keys()
            if again:
                raise ConfigurationError(
                    f"the recording {min(again)} is given twice, expected different names"
                )
            for name, sha256 in found.recordings.items():
                original = contents.original_of(name, sha256)
                if original is not None:
                    remark(f"{name} has the same content as {original}: both are scored")
            result.merge(found)
    return result, failures


_Files = tuple[tuple[str, Path, str], ...]
"""Models by name, each with its file and the hash of its bytes."""

_loaded: dict[_Files, dict[str, ModelRunner]] = {}
"""The models of this process: loaded once, since a process scores many recordings. The
process that was called has tried them."""


@dataclass(frozen=True)
class _Scoring:
    """Scores the models on the recordings of some files, in any process.

    Attributes:
        models: their names and files.
        settings: see :class:`Settings`.
        cache: cache of recordings.
        resume: folder of the results, if they are kept.
        draw: models whose best and worst scenes are kept.
        progress: show a bar for each recording.
    """

    models: _Files
    settings: Settings
    cache: RecordingCache | None
    resume: Path | None
    draw: tuple[str, ...]
    progress: bool

    def __call__(self, item: SourceJob) -> Evaluation:
        """Return the results on the recordings of some files."""
        if self.resume is None:
            return self._score(item)
        facts = {
            "what": "evaluation",
            "name": item.name,
            "recordings": item.job.facts(),
            "models": [[name, sha256] for name, _, sha256 in self.models],
            "settings": dataclasses.asdict(self.settings),
        }
        classes = (Evaluation, ScoreTable, HonestyTable, GroupSums)
        make = functools.partial(self._score, item)
        return kept_or_made(self.resume, facts, make, classes, evaluate_all)

    def _score(self, item: SourceJob) -> Evaluation:
        if self.models not in _loaded:
            _loaded.clear()
            _loaded[self.models] = {
                name: ModelRunner.load(path, sha256=sha256, trusted=True)
                for name, path, sha256 in self.models
            }
        runners = _loaded[self.models]
        result = Evaluation(scenes={name: ExtremeScenes() for name in self.draw})
        for name, recording in item.read(self.cache):
            bar = tqdm(desc=name, unit="frame", disable=not self.progress, leave=False)
            with bar:

                def begin(name: str, frames: int, bar: tqdm = bar) -> Callable[[], object]:
                    bar.total = frames
                    return bar.update

                result.merge(
                    evaluate_all(
                        runners,
                        [(name, recording)],
                        self.settings,
                        sites={name: site_of(recording, name)},
                        draw=self.draw,
                        progress=begin,
                    )
                )
        return result
