# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Of several runs the one that predicts its validation recordings best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.run_folder import Checkpoint, load_checkpoint


@dataclass(frozen=True)
class Candidate:
    """A run that may be exported.

    Attributes:
        path: checkpoint or run folder, as it was given.
        checkpoint: what was read there.
    """

    path: Path
    checkpoint: Checkpoint

    @property
    def ade_m(self) -> float:
        """ADE of all agents on the validation recordings (m)."""
        return float(self.checkpoint["metrics"]["model"]["all"]["ade"])

    @property
    def seed(self) -> int:
        """Of its training."""
        return int(self.checkpoint["config"]["seed"])

    @property
    def judged_on(self) -> set[tuple[str, str]]:
        """Names and SHA-256 of the recordings, or their parts, that judged it."""
        return {
            (split["name"], split["sha256"])
            for split in self.checkpoint["splits"]
            if split["split"] == "validation"
        }


def choose(paths: Sequence[Path]) -> tuple[Candidate, list[Candidate]]:
    """The candidate with the smallest validation ADE, and all of them in the order given.

    Raises:
        ConfigurationError: one cannot be read, or of several one has no validation yet or was
            judged on other recordings than the first.
    """
    candidates = [Candidate(path, load_checkpoint(path)) for path in paths]
    first = candidates[0]
    if len(candidates) == 1:
        return first, candidates
    for other in candidates:
        if not other.checkpoint["metrics"]:
            raise ConfigurationError(
                f"{other.path} has not been validated yet, expected runs with a whole epoch to "
                "choose between them"
            )
        if other.judged_on != first.judged_on:
            raise ConfigurationError(
                f"{other.path} was validated on {_listed(other)} and {first.path} on "
                f"{_listed(first)}, expected the same recordings to choose between them"
            )
    return min(candidates, key=lambda candidate: candidate.ade_m), candidates


def _listed(candidate: Candidate) -> str:
    return ", ".join(sorted(name for name, _ in candidate.judged_on)) or "nothing"
