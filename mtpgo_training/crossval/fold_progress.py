# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a cross-validation says while its folds run."""

from __future__ import annotations

import sys

from mtpgo_core.errors import MtpgoError
from mtpgo_training.crossval.crossval_folder import CrossvalFolder
from mtpgo_training.crossval.fold import FoldJob
from mtpgo_training.crossval.site_scores import is_scored


class FoldProgress:
    """Says which folds are started, how they went, and which failed.

    Args:
        folder: of the results, which are written again after each fold.
        tracker: observations whose errors are said.
        quiet: print errors only.

    Attributes:
        failures: names of the folds that failed.
    """

    def __init__(self, folder: CrossvalFolder, tracker: str, *, quiet: bool) -> None:
        self._folder, self._tracker, self._quiet = folder, tracker, quiet
        self.failures: list[str] = []

    def say(self, text: str) -> None:
        """Print a line at once, unless only errors are wanted."""
        if not self._quiet:
            print(text, flush=True)

    def started(self, job: FoldJob) -> None:
        """Say that a fold is started."""
        self.say(
            f"{job.fold.name}: leaves out {', '.join(site.name for site in job.fold.sites)} "
            f"({len(job.fold.recordings)} recordings), see {self._folder.fold(job.fold.name).log}"
        )

    def finished(self, job: FoldJob) -> None:
        """Write the results so far and say how a fold went."""
        folds = self._folder.write_results()["folds"]
        fold = next(one for one in folds if one["fold"] == job.fold.name)
        training = fold["training"]
        self.say(
            f"{job.fold.name}: {training['epochs_done']} of {training['epochs']} epochs in "
            f"{training['minutes']:.1f} min"
        )
        for name, site in fold["sites"].items():
            scores = site["scores"][self._tracker]
            moving = scores.get("moving", {})
            ade, cv = moving.get("ade"), moving.get("ade_cv")
            result = "nothing moves" if is_scored(scores) else "nothing could be scored"
            if ade is not None:
                result = f"moving ADE {ade:.3f} m (CV {cv:.3f})"
            self.say(f"  {name}: {result}")

    def failed(self, job: FoldJob, error: MtpgoError) -> None:
        """Say that a fold failed; the others go on."""
        self.failures.append(job.fold.name)
        print(f"mtpgo: without {job.fold.name}: {error}", file=sys.stderr, flush=True)
