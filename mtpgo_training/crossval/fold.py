# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One fold: train without its sites, export, and score the model file on each of them."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.atomic_files import read_json, write_text
from mtpgo_training.calibration.calibration_samples import (
    CalibrationSamples,
    SampledRecording,
    merge_samples,
)
from mtpgo_training.crossval.crossval_folder import FoldFolder
from mtpgo_training.crossval.fold_samples import SampledEvaluation
from mtpgo_training.crossval.planned_training import train_planned, write_training
from mtpgo_training.crossval.site_folds import Fold, FoldSite, without_fold
from mtpgo_training.crossval.site_scores import MODEL, group_scores
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.evaluator import Settings, evaluate_recording
from mtpgo_training.evaluation.honesty.honesty_summary import honesty_summary
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.export.exporter import export_runs
from mtpgo_training.scenes.tracker.tracker_config import RECORDED, SIMULATED
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import CrossvalConfig, TrainingConfig
from mtpgo_training.training.trial.schedule_plan import Budget

Json = dict[str, Any]

TRACKER_SEEDS: dict[str, int | None] = {RECORDED: None, SIMULATED: 0}
"""What the observations of left-out sites come from, with the seed of the simulated tracker."""


@dataclass(frozen=True)
class FoldJob:
    """What a fold is made of; small, to be sent to a process.

    Attributes:
        fold: the sites that are left out.
        config: the configuration of the cross-validation.
        sources: the directories of recordings.
        cache: folder of the cache, None for none.
        folder: folder of the fold.
        budget: how long it may train.
        stride_s: time between two scored instants (s).
        trackers: whose observations it is scored with, of :data:`TRACKER_SEEDS`.
        init_from: run folder whose weights the training begins with, None for none.
    """

    fold: Fold
    config: TrainingConfig
    sources: tuple[DataSource, ...]
    cache: Path | None
    folder: Path
    budget: Budget
    stride_s: float
    trackers: tuple[str, ...] = (RECORDED,)
    init_from: Path | None = None

    def run(self) -> bool:
        """Run it, see :func:`run_fold`."""
        return run_fold(self)


def run_fold(job: FoldJob) -> bool:
    """Train without the sites and score on each, or continue where a run before was interrupted.

    A training that is done is not continued: it is exported and scored.

    Returns:
        Whether the fold is done: not if a signal has ended its training.

    Raises:
        MtpgoError: the recordings or the configuration cannot be used.
    """
    prepare_process(1)  # so that scores do not depend on whether this process has trained
    files = FoldFolder(job.folder)
    cache = None if job.cache is None else RecordingCache(job.cache)
    recordings = list(read_sources(job.sources, cache))
    if not (files.training.is_file() or _train(job, files, recordings, cache)):
        return False
    # A model that was trained for a few minutes may have ellipses that an export refuses.
    export_runs([files.run], files.model, name=_name(job.config, job.fold), force=True)
    start = time.monotonic()
    runner = ModelRunner.load(files.model, trusted=True)
    scores, samples = {}, []
    for site in job.fold.sites:
        left_out = [item for item in recordings if item.name in site.recordings]
        scores[site.name], parts = _scores(job, runner, site, left_out)
        samples += parts
    if samples:
        merge_samples(samples).save(files.samples)
    content: Json = {
        "fold": job.fold.name,
        "training": read_json(files.training, "how a fold was trained"),
        "scoring_seconds": round(time.monotonic() - start, 1),
        "sites": scores,
    }
    write_text(files.scores, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return True


def _train(
    job: FoldJob,
    files: FoldFolder,
    recordings: Sequence[NamedRecording],
    cache: RecordingCache | None,
) -> bool:
    """Train, or continue the training; return whether it is done."""
    config, others = without_fold(_for_one_thread(job.config, job.fold), recordings, job.fold)
    done = train_planned(files, config, others, job.budget, cache, init_from=job.init_from)
    if done is None:
        return False
    run, plan = done
    write_training(files, run, plan, _training(run, files.run))
    return True


def _scores(
    job: FoldJob, runner: ModelRunner, site: FoldSite, recordings: Sequence[NamedRecording]
) -> tuple[Json, list[CalibrationSamples]]:
    """Return the scores on a site with each tracker, and the samples for a calibration."""
    content: Json = {
        "recordings": [item.name for item in recordings],
        "scores": {},
        "breakdowns": {},
    }
    samples = []
    for tracker in job.trackers:
        settings = Settings(
            stride_s=job.stride_s, centre=False, tracker_seed=TRACKER_SEEDS[tracker]
        )
        tested = job.config.data.test
        result = score_site(runner, site.name, recordings, settings, tested)
        content["scores"][tracker] = group_scores(result.scores, result.honesty)
        honesty = honesty_summary(result.honesty)
        content["breakdowns"][tracker] = breakdowns(result.scores) | {"honesty": honesty}
        samples.append(result.samples(runner.task.calibration))
    return content, [part for part in samples if part is not None]


def score_site(
    runner: ModelRunner,
    site: str,
    recordings: Sequence[NamedRecording],
    settings: Settings,
    tested: Sequence[str] = (),
) -> SampledEvaluation:
    """Score a model and the baselines on all recordings of a site, as ``mtpgo evaluate`` does.

    Args:
        runner: the model.
        site: name of the site in the scores and the samples.
        recordings: of the site.
        settings: what is scored.
        tested: names of recordings for the test: no calibration may be fitted to them, so their
            predictions are no samples.
    """
    result = SampledEvaluation()
    for item in recordings:
        result.keeps_samples = not item.is_named(tested)
        if result.keeps_samples:
            result.sampled.append(_sampled(item))
        if len(item.recording):
            recording = dataclasses.replace(item.recording, location=site)
            evaluate_recording(result, {MODEL: runner}, recording, settings, name=item.name)
    return result


def _sampled(item: NamedRecording) -> SampledRecording:
    """Return what samples say of a recording that they are of."""
    recording = item.recording
    return SampledRecording(recording.name, item.source, recording.layout, recording.sha256)


def _name(config: TrainingConfig, fold: Fold) -> str:
    """Return the name of the model of a fold."""
    return f"{config.name}-without-{fold.name}"


def _for_one_thread(config: TrainingConfig, fold: Fold) -> TrainingConfig:
    """Return the configuration of a fold: one process with one thread."""
    return dataclasses.replace(
        config,
        name=_name(config, fold),
        num_threads=1,
        crossval=CrossvalConfig(),
        trainer=dataclasses.replace(
            config.trainer, devices=1, num_nodes=1, strategy="auto", loader_workers=0
        ),
    )


def _training(run: TrainingRun, folder: Path) -> Json:
    """Return what the fold was trained with, besides its schedule."""
    state = run.state
    splits = load_checkpoint(folder)["splits"]
    return {
        "minutes": round(state.total_seconds / 60.0, 2),
        "validation_ade_m": state.metrics["model"]["all"]["ade"] if state.metrics else None,
        "train": _names(splits, "train"),
        "validation": _names(splits, "validation"),
    }


def _names(splits: list[dict[str, str]], use: str) -> list[str]:
    return [f"{one['source']}/{one['name']}" for one in splits if one["split"] == use]
