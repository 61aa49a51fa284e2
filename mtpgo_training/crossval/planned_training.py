# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training with a budget that is one of many: its files, its schedule, and how it continues."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import is_new, read_json, write_text
from mtpgo_training.crossval.fold_plan import plan_fold
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.run_files import FACTS_FILE, PLAN_FILE
from mtpgo_training.training.run_folder import RunFolder, versions
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.schedule_plan import Budget, SchedulePlan

Json = dict[str, Any]


class PlannedFiles:
    """The files of one training.

    Attributes:
        path: the folder.
        plan: its schedule.
        run: the run folder of the training.
        training: how it was trained; written when the training is done.
        model: the exported model.
        log: what it printed.
        scores: the result; written last.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plan = path / PLAN_FILE
        self.run = path / "run"
        self.training = path / "training.json"
        self.model = path / "model.pt"
        self.log = path / "fold.log"
        self.scores = path / "scores.json"

    @property
    def done(self) -> bool:
        """Whether it is trained and scored."""
        return self.scores.is_file()


def train_planned(
    files: PlannedFiles,
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    budget: Budget,
    cache: RecordingCache | None,
    *,
    find_rate: bool = False,
    init_from: Path | None = None,
) -> tuple[TrainingRun, SchedulePlan] | None:
    """Train, or continue the training where it was interrupted.

    Args:
        files: of the training; its schedule is made if there is none yet.
        config: without the schedule.
        recordings: to train and validate on.
        budget: how long it may train.
        cache: keeps what is expensive to compute.
        find_rate: take the learning rate from a range test.
        init_from: run folder whose weights to begin with.

    Returns:
        The training and its schedule; None if a signal has ended it before.
    """
    if files.plan.is_file():
        plan = SchedulePlan.load(files.plan)
    else:
        plan = plan_fold(config, recordings, budget, cache)
        plan.save(files.plan)
    print(f"plan       {plan}", flush=True)
    folder = RunFolder(files.run)
    run = train(
        plan.applied(config, recordings),
        recordings,
        folder,
        resume=(files.run / FACTS_FILE).is_file(),
        init_from=None if folder.last.exists() else init_from,
        find_rate=find_rate,
        max_minutes=plan.limit_minutes,
        cache=cache,
        verbose=True,
    )
    return None if run.received_signal is not None else (run, plan)


def write_training(
    files: PlannedFiles, run: TrainingRun, plan: SchedulePlan, more: Mapping[str, Any]
) -> None:
    """Write how a training was done.

    Args:
        files: of the training.
        run: the training.
        plan: its schedule.
        more: values besides schedule, epochs and steps.
    """
    content: Json = {
        **dataclasses.asdict(plan),
        "epochs_done": run.state.epoch,
        "steps": run.state.step,
        "best_epoch": run.state.best_epoch,
        **more,
    }
    write_text(files.training, json.dumps(content, indent=1, allow_nan=False) + "\n")


def require_folder_of(facts: Path, kind: str) -> None:
    """Check that a folder is new or has trainings of a kind in it.

    Other processes may begin with the same trainings at this moment, as the tasks of a job array
    do: what one of them is about to write is nothing else.

    Args:
        facts: the file in the folder that says what is trained, the first that is written.
        kind: what the folder is to hold, such as ``study``.

    Raises:
        ConfigurationError: there is something else.
    """
    folder = facts.parent
    others = not is_new(folder) and (
        not folder.is_dir()
        or any(not entry.name.startswith(f".{facts.name}.") for entry in folder.iterdir())
    )
    if others and not facts.is_file():  # in this order: the file is there before any other
        raise ConfigurationError(
            f"--out is {folder}, which holds no {kind}, expected a new folder or one to continue"
        )


def keep_facts(path: Path, facts: Json, kind: str, long: Collection[str]) -> None:
    """Write what determines the results of trainings, or check that it is the same as before.

    Args:
        path: the file, in the folder of the trainings.
        facts: what determines the results.
        kind: what the folder holds, such as ``study``.
        long: names of values that are too long to be printed.

    Raises:
        ConfigurationError: something differs, or the folder has something else in it.
    """
    require_folder_of(path, kind)
    if not path.is_file():
        write_text(path, json.dumps({**facts, "versions": versions()}, indent=2) + "\n")
        return
    before = read_json(path, f"what determines the results of a {kind}")
    require_same_facts(before, facts, path, long)


def require_same_facts(before: Json, facts: Json, path: Path, long: Collection[str]) -> None:
    """Check that what determines the results is the same as before.

    Args:
        before: as it was stored.
        facts: as it is asked for now.
        path: where it was stored.
        long: names of values that are too long to be printed.

    Raises:
        ConfigurationError: something differs.
    """
    different = next((key for key in facts if before.get(key) != facts[key]), None)
    if different in long:
        raise ConfigurationError(
            f"the {different} differ from those in {path}, expected the same or another --out"
        )
    if different is not None:
        raise ConfigurationError(
            f"{different} is {facts[different]}, but {before.get(different)} in {path}, expected "
            "the same or another --out"
        )
