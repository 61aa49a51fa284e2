# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Of several runs the one that predicts its validation recordings best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.run_folder import Checkpoint, load_checkpoint


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
    def judged_on(self) -> dict[str, str]:
        """SHA-256 of the recordings that judged it -> their names."""
        return {
            split["sha256"]: split["name"]
            for split in self.checkpoint["splits"]
            if split["split"] == "validation"
        }


def choose(paths: Sequence[Path]) -> tuple[Candidate, list[Candidate]]:
    """The candidate with the smallest validation ADE, and all of them in the order given.

    Raises:
        ConfigurationError: one cannot be read, or two were judged on different recordings.
    """
    candidates = [Candidate(path, load_checkpoint(path)) for path in paths]
    first = candidates[0]
    for other in candidates[1:]:
        if other.judged_on != first.judged_on:
            raise ConfigurationError(
                f"{other.path} was validated on {_listed(other)} and {first.path} on "
                f"{_listed(first)}, expected the same recordings to choose between them"
            )
    if len(candidates) == 1:
        return first, candidates
    return min(candidates, key=lambda candidate: candidate.ade_m), candidates


def _listed(candidate: Candidate) -> str:
    return ", ".join(candidate.judged_on.values()) or "nothing"
