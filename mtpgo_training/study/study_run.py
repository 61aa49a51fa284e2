# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One run of a study: train a row with a seed, export, and score on the test recordings."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mtpgo_core.errors import MtpgoError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_training.atomic_files import read_json, write_text
from mtpgo_training.crossval.planned_training import (
    PlannedFiles,
    train_planned,
    write_training,
)
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.evaluator import Evaluation, Settings, evaluate_all
from mtpgo_training.evaluation.scores.score_table import scores_by
from mtpgo_training.export.exporter import export_runs
from mtpgo_training.study.extrapolation import extrapolated_errors
from mtpgo_training.study.paper_tables import BY_KERNELS
from mtpgo_training.study.study_data import study_data
from mtpgo_training.study.study_rows import Study, StudyError, StudyRow
from mtpgo_training.training.networks import parameter_count
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.schedule_plan import Budget

Json = dict[str, Any]

MODEL = "model"
"""Name of a run's model in its scores."""

KERNEL_SAMPLES = 200
"""Samples of a prediction for likelihoods by kernels. Chosen: a tenth of the published number,
which takes longer than all else of the scoring."""


class RunFiles(PlannedFiles):
    """The files of one run.

    Attributes:
        failure: why it failed.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.failure = path / "failure.json"

    def result(self) -> Json | None:
        """Return the scores, None if the run is not done."""
        if not self.done:
            return None
        return read_json(self.scores, "the scores of a run", ("seed", "training", "values"))

    def error(self) -> str | None:
        """Return why the run failed, None if it did not."""
        if self.done or not self.failure.is_file():
            return None
        return str(read_json(self.failure, "why a run failed").get("error", ""))

    def write_error(self, error: Exception) -> None:
        """Note why the run failed."""
        write_text(self.failure, json.dumps({"error": str(error)}, indent=1) + "\n")


def missing_text(runs: Mapping[int, RunFiles]) -> str | None:
    """Return why runs of a line of the table are missing, None if none is.

    Args:
        runs: by seed.
    """
    errors = {seed: files.error() for seed, files in runs.items() if not files.done}
    parts = [f"seed {seed} failed: {text}" for seed, text in errors.items() if text]
    waiting = [str(seed) for seed, text in errors.items() if not text]
    if waiting:
        parts.append(f"not run yet: seed {', '.join(waiting)}")
    return "; ".join(parts) or None


@dataclass(frozen=True)
class StudyRun:
    """What a run is made of; small, to be sent to a process.

    Attributes:
        study: which study.
        row: of its table.
        seed: of the training.
        config: of the row.
        first: configuration of the study's first row, by which the recordings are split.
        sources: the directories of recordings.
        cache: folder of the cache, None for none.
        folder: folder of the run.
        budget: how long it may train.
        stride_s: time between two scored instants (s).
        extrapolate_s: longer horizon that is scored too (s), None for none.
        find_rate: take the learning rate from a range test.
        gpu: number of the GPU that it sees, None for all.
    """

    study: Study
    row: StudyRow
    seed: int
    config: TrainingConfig
    first: TrainingConfig
    sources: tuple[DataSource, ...]
    cache: Path | None
    folder: Path
    budget: Budget
    stride_s: float
    extrapolate_s: float | None = None
    find_rate: bool = False
    gpu: int | None = None

    @property
    def name(self) -> str:
        """Row and seed."""
        return f"{self.row.name}-seed{self.seed}"

    def run(self) -> bool:
        """Run it, or continue it where it was interrupted.

        Returns:
            Whether it is done: not if a signal has ended its training.

        Raises:
            MtpgoError: it cannot be trained, exported or scored.
        """
        if self.gpu is not None:
            os.environ["CUDA_VISIBLE_DEVICES"] = str(self.gpu)  # before CUDA is first used
        prepare_process(1)
        files = RunFiles(self.folder)
        cache = None if self.cache is None else RecordingCache(self.cache)
        data = study_data(self.study, self.first, list(read_sources(self.sources, cache)))
        if not files.training.is_file():
            config = dataclasses.replace(
                data.of(self.config), name=self.name, seed=self.seed, num_threads=1
            )
            if not self._train(files, config, data.recordings, cache):
                return False
        # A model that was trained for a few minutes may have ellipses that an export refuses.
        export_runs([files.run], files.model, name=self.name, force=True)
        start = time.monotonic()
        content: Json = {
            "row": self.row.name,
            "seed": self.seed,
            "training": read_json(files.training, "how a run was trained"),
            **score(files.model, data.splits.test, self.study, self.row, self.stride_s),
        }
        if self.extrapolate_s is not None:
            content["extrapolation"] = self._extrapolated(files, data.splits.test)
        content["scoring_seconds"] = round(time.monotonic() - start, 1)
        write_text(files.scores, json.dumps(content, indent=1, allow_nan=False) + "\n")
        files.failure.unlink(missing_ok=True)
        return True

    def _train(
        self,
        files: RunFiles,
        config: TrainingConfig,
        recordings: Sequence[NamedRecording],
        cache: RecordingCache | None,
    ) -> bool:
        """Train, or continue the training; return whether it is done."""
        done = train_planned(
            files, config, recordings, self.budget, cache, find_rate=self.find_rate
        )
        if done is None:
            return False
        run, plan = done
        minutes = run.state.total_seconds / 60.0
        speed = {
            "minutes": round(minutes, 3),
            "steps_per_second": round(run.state.step / max(60.0 * minutes, 1e-3), 3),
            "parameters": parameter_count(run.model),
        }
        write_training(files, run, plan, speed)
        return True

    def _extrapolated(self, files: RunFiles, test: Sequence[NamedRecording]) -> Json:
        """Return the errors beyond the horizon, or why there are none."""
        assert self.extrapolate_s is not None
        try:
            return extrapolated_errors(
                files.run,
                files.path / "longer.pt",
                test,
                self.extrapolate_s,
                Settings(self.study.policy, self.stride_s, centre=False),
            )
        except MtpgoError as error:
            return {"gap": str(error)}


def score(
    model: Path, test: Sequence[NamedRecording], study: Study, row: StudyRow, stride_s: float
) -> Json:
    """Return the scores of a model and of the baselines for the same road users.

    ``values``: by model (:data:`MODEL`, ``cv``, ``ca``, ``ctrv``), the averages; ``by_class``: by
    model and class.

    Args:
        model: the file.
        test: recordings.
        study: which policy it is scored by.
        row: whether likelihoods by kernels are wanted, too.
        stride_s: time between two scored instants (s).
    """
    by_kernels = row.name in (*BY_KERNELS, "mtp-go2") and study.name == "comparison"
    settings = Settings(
        study.policy, stride_s, centre=False, kde_samples=KERNEL_SAMPLES if by_kernels else 0
    )
    runner = ModelRunner.load(model, trusted=True)
    result: Evaluation = evaluate_all(
        {MODEL: runner}, [(item.name, item.recording) for item in test], settings
    )
    if not result.scores:
        raise StudyError(
            "nothing could be scored: no road user of the test is predicted and then observed"
        )
    averages = result.scores.averages()
    by_class: Json = {}
    for (name, kind), values in scores_by(
        result.scores.agents(), ["model", "agent_class"]
    ).items():
        by_class.setdefault(name, {})[kind] = values
    return {"values": {name: row["all"] for name, row in averages.items()}, "by_class": by_class}
