# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Selects the best of several training runs by its validation ADE."""

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
        path: checkpoint or run folder, as given.
        checkpoint: its content.
    """

    path: Path
    checkpoint: Checkpoint

    @property
    def ade_m(self) -> float:
        """ADE over all agents of the validation recordings (m)."""
        return float(self.checkpoint["metrics"]["model"]["all"]["ade"])

    @property
    def seed(self) -> int:
        """Seed of its training."""
        return int(self.checkpoint["config"]["seed"])

    @property
    def horizon(self) -> str:
        """Steps of its horizon and time between two of them."""
        config = self.checkpoint["model_config"]
        return f"{config.get('horizon_steps')} steps of {config.get('dt_s')} s"

    @property
    def validated_on(self) -> set[tuple[str, str]]:
        """Names and SHA-256 of its validation recordings, or parts of recordings."""
        return {
            (split["name"], split["sha256"])
            for split in self.checkpoint["splits"]
            if split["split"] == "validation"
        }


def select_run(paths: Sequence[Path]) -> tuple[Candidate, list[Candidate]]:
    """Return the run with the smallest validation ADE, and all runs in the order given.

    Args:
        paths: checkpoints or run folders.

    Raises:
        ConfigurationError: a checkpoint cannot be read; or, of several runs, one has not been
            validated yet, or was validated on other recordings or over another horizon than the
            first.
    """
    candidates = [Candidate(path, load_checkpoint(path)) for path in paths]
    first = candidates[0]
    if len(candidates) == 1:
        return first, candidates
    for other in candidates:
        if not other.checkpoint["metrics"]:
            raise ConfigurationError(
                f"{other.path} has not been validated yet, expected runs with a complete epoch to "
                "choose between them"
            )
        if other.validated_on != first.validated_on:
            raise ConfigurationError(
                f"{other.path} was validated on {_listed(other)} and {first.path} on "
                f"{_listed(first)}, expected the same recordings to choose between them"
            )
        if other.horizon != first.horizon:
            raise ConfigurationError(
                f"{other.path} predicts {other.horizon} and {first.path} {first.horizon}, "
                "expected the same horizon to choose between them by their error"
            )
    return min(candidates, key=lambda candidate: candidate.ade_m), candidates


def _listed(candidate: Candidate) -> str:
    return ", ".join(sorted(name for name, _ in candidate.validated_on)) or "nothing"
