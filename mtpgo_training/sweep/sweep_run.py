# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One run of a sweep: a training with one combination of values, and its validation."""

from __future__ import annotations

import dataclasses
import json
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import write_text
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.study.study_data import StudyData
from mtpgo_training.study.study_run import RunFiles
from mtpgo_training.sweep.sweep_grid import GridPoint
from mtpgo_training.training.networks import horizon_steps, parameter_count
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import TrainingConfig

Json = dict[str, Any]


@dataclass(frozen=True)
class SweepOptions:
    """How all runs of a sweep are trained.

    Attributes:
        base: the configuration without the swept values, by which the recordings are split.
        splits_once: all runs have the same training and validation recordings: not if values of
            the section ``data`` are swept.
        sources: the directories of recordings.
        cache: folder of the cache, None for none.
        init_from: checkpoint whose weights to start from.
        find_rate: take the learning rate of each run from a range test.
        minutes: time of each run (min), into which its schedule is made to fit.
        max_minutes: time of each run (min) with the schedule as it is.
    """

    base: TrainingConfig
    splits_once: bool
    sources: tuple[DataSource, ...]
    cache: Path | None = None
    init_from: Path | None = None
    find_rate: bool = False
    minutes: float | None = None
    max_minutes: float | None = None


@dataclass(frozen=True)
class SweepRun:
    """What a run is made of; small, to be sent to a process.

    Attributes:
        point: the combination.
        config: the configuration with its values.
        options: what it has in common with the others.
        folder: its folder.
    """

    point: GridPoint
    config: TrainingConfig
    options: SweepOptions
    folder: Path

    @property
    def name(self) -> str:
        """Name of the combination."""
        return self.point.name

    def run(self) -> bool:
        """Train, or continue where it was interrupted.

        Returns:
            Whether it is done: not if a signal has ended the training.

        Raises:
            MtpgoError: it cannot be trained.
        """
        started_s = time.monotonic()
        options, files = self.options, RunFiles(self.folder)
        cache = None if options.cache is None else RecordingCache(options.cache)
        recordings = list(read_sources(options.sources, cache))
        config = self.config
        if options.splits_once:
            config, recordings = same_split(options.base, config, recordings)
        folder = RunFolder(files.run)
        resume = folder.last.is_file()
        if not resume:
            shutil.rmtree(files.run, ignore_errors=True)  # it ended before its first checkpoint
        limit = options.max_minutes if options.minutes is None else options.minutes
        run = train(
            config,
            recordings,
            folder,
            resume=resume,
            init_from=None if resume else options.init_from,
            find_rate=options.find_rate,
            max_minutes=limit,
            shorten=options.minutes is not None,
            started_s=started_s,
            cache=cache,
            verbose=True,
        )
        if run.received_signal is not None:
            return False
        write_text(files.scores, json.dumps(self._result(run), indent=1, allow_nan=False) + "\n")
        files.failure.unlink(missing_ok=True)
        return True

    def _result(self, run: TrainingRun) -> Json:
        state = run.state
        if not state.metrics:
            raise ConfigurationError("the run has no validation, expected at least one epoch")
        return {
            "name": self.name,
            "settings": dict(self.point.settings),
            "seed": self.point.seed,
            "values": {name: row["all"] for name, row in state.metrics.items() if "all" in row},
            "training": {
                "minutes": round(state.total_seconds / 60.0, 3),
                "epochs": state.epoch,
                "of_epochs": run.config.optimisation.epochs,
                "best_epoch": state.best_epoch,
                "steps": state.step,
                "parameters": parameter_count(run.model),
            },
            "validation": list(run.config.data.validation) if self.options.splits_once else None,
            "horizon": {"steps": run.model.config.horizon_steps, "dt_s": run.model.config.dt_s},
        }


def same_split(
    base: TrainingConfig, config: TrainingConfig, recordings: Sequence[NamedRecording]
) -> tuple[TrainingConfig, list[NamedRecording]]:
    """Return a configuration that splits the recordings as the base does, whatever its seed.

    Args:
        base: the configuration without the swept values.
        config: with them.
        recordings: all of them.

    Returns:
        The configuration, and the recordings or parts of recordings that it names.
    """
    guard_s = window_s(base.history, horizon_steps(base.model))
    data = StudyData(split(recordings, base.data, base.seed, guard_s))
    return data.of(config), data.recordings


def for_one_process(config: TrainingConfig, at_once: int) -> TrainingConfig:
    """Return a configuration for one of several trainings at the same time: one process each.

    Args:
        config: the configuration.
        at_once: trainings at the same time, which share its number of threads.
    """
    trainer = dataclasses.replace(config.trainer, devices=1, num_nodes=1, strategy="auto")
    threads = max(1, config.num_threads // at_once) if config.num_threads else 0
    return dataclasses.replace(config, trainer=trainer, num_threads=threads)
