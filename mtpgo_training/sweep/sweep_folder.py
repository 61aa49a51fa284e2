# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a sweep.

``sweep.json`` (configuration, recordings with their hashes, limits) is written at the start.
``runs/NAME/`` has the run folder of a combination, what it printed, and at last
``scores.json``: a run with that file is done. The tables are written again after each run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_training.crossval.planned_training import keep_facts, require_folder_of
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.study.study_run import RunFiles
from mtpgo_training.sweep.sweep_run import SweepOptions
from mtpgo_training.training.training_config import TrainerConfig, dump_config

Json = dict[str, Any]


class SweepFolder:
    """The files of a sweep.

    Args:
        path: the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._facts = path / "sweep.json"

    def run(self, name: str) -> RunFiles:
        """Return the files of a run."""
        return RunFiles(self.path / "runs" / name)

    def require_usable(self) -> None:
        """Check that the folder is new or holds a sweep.

        Raises:
            ConfigurationError: there is something else in it.
        """
        require_folder_of(self._facts, "sweep")

    def start(self, options: SweepOptions, recordings: Sequence[NamedRecording]) -> None:
        """Write what determines the results, or check that it is the same as before.

        Values and seeds may be added, devices and threads may differ.

        Args:
            options: of all runs.
            recordings: all of them.

        Raises:
            ConfigurationError: the folder has something else in it, or it cannot be written.
        """
        trainer = TrainerConfig(
            validate_every_epochs=options.base.trainer.validate_every_epochs,
            patience_epochs=options.base.trainer.patience_epochs,
        )
        base = dataclasses.replace(options.base, num_threads=1, trainer=trainer)
        facts: Json = {
            "configuration": dump_config(base),
            "recordings": {item.name: item.recording.sha256 for item in recordings},
            "init_from": None if options.init_from is None else str(options.init_from.resolve()),
            "find_lr": options.find_rate,
            "minutes": options.minutes,
            "max_minutes": options.max_minutes,
        }
        keep_facts(self._facts, facts, "sweep", ("configuration", "recordings"))
