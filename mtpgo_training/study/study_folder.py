# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a study.

``study.json`` (study, data set, recordings with their hashes, split, budget, configurations of the
rows) is written at the start. ``runs/ROW-seedN/`` has the schedule of a run, its run folder, the
exported model, what it printed, and at last ``scores.json``: a run with that file is done. The
tables are written again after each run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import write_text
from mtpgo_training.crossval.planned_training import keep_facts, require_folder_of
from mtpgo_training.data.splits import USES
from mtpgo_training.study.study_data import StudyData
from mtpgo_training.study.study_run import RunFiles
from mtpgo_training.training.run_folder import first_difference
from mtpgo_training.training.training_config import (
    TrainerConfig,
    TrainingConfig,
    dump_config,
    load_config,
)
from mtpgo_training.training.trial.schedule_plan import Budget

Json = dict[str, Any]


class StudyFolder:
    """The files of a study.

    Args:
        path: the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._facts = path / "study.json"

    def run(self, row: str, seed: int) -> RunFiles:
        """Return the files of a run."""
        return RunFiles(self.path / "runs" / f"{row}-seed{seed}")

    def _config(self, row: str) -> Path:
        return self.path / "configs" / f"{row}.yaml"

    def require_usable(self) -> None:
        """Check that the folder is new or holds a study.

        Raises:
            ConfigurationError: there is something else in it.
        """
        require_folder_of(self._facts, "study")

    def start(
        self,
        facts: Json,
        data: StudyData,
        configs: Mapping[str, TrainingConfig],
        budget: Budget,
    ) -> None:
        """Write what determines the results, or check that it is the same as before.

        Rows and seeds may be added, and devices may differ.

        Args:
            facts: study, data set, and how it is scored.
            data: its recordings.
            configs: of the rows.
            budget: of each run.

        Raises:
            ConfigurationError: the folder has something else in it, or it cannot be written.
        """
        facts = {
            **facts,
            "budget": dataclasses.asdict(budget),
            "recordings": {item.name: item.recording.sha256 for item in data.recordings},
            "split": {use: [item.name for item in getattr(data.splits, use)] for use in USES},
        }
        keep_facts(self._facts, facts, "study", ("recordings", "split"))
        for row, config in configs.items():
            self._start_row(row, config)

    def _start_row(self, row: str, config: TrainingConfig) -> None:
        path = self._config(row)
        config = dataclasses.replace(
            config,
            num_threads=1,
            trainer=TrainerConfig(patience_epochs=config.trainer.patience_epochs),
        )
        if not path.is_file():
            write_text(path, dump_config(config))
            return
        stored = load_config(path)
        if stored != config:
            raise ConfigurationError(
                f"the configuration of the row {row} differs from {path} in "
                f"{first_difference(stored, config)}, expected the same or another --out"
            )
