# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration that an exported model gets, and the check of its ellipses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.calibration import Calibration
from mtpgo_training.calibration.calibration_report import with_moving_scores
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.calibration.calibration_text import is_moving_score, moving_coverage
from mtpgo_training.export.run_selection import Candidate
from mtpgo_training.training.run_folder import Checkpoint, RunFolder

COVERAGE_LIMITS = (0.80, 0.98)
"""A model whose 90 % ellipses hold less or more than this share of the moving validation road
users is not exported unless forced; chosen: so far from 90 % that it cannot be chance."""

LEAST_AGENTS = 50
"""With fewer moving validation road users nothing is refused; chosen: the standard deviation of
the share is then more than 4 %."""

OF_COVARIANCES = ("anll", "fnll", "coverage_50", "coverage_90", "coverage_95")
"""Validation scores that another calibration changes."""


def own_calibration(checkpoint: Checkpoint) -> Calibration:
    """Return the calibration of a checkpoint, none for one of an earlier version.

    Raises:
        ConfigurationError: it is not usable.
    """
    return from_dict(
        Calibration, checkpoint.get("calibration", {}), "the checkpoint's calibration"
    )


def validation_samples(path: Path) -> CalibrationSamples | None:
    """Return the validation samples of a run, None where there are none.

    Args:
        path: run folder, or its best checkpoint.

    Raises:
        ConfigurationError: there are some that cannot be read.
    """
    folder = RunFolder(path if path.is_dir() else path.parent)
    if path not in (folder.path, folder.best) or not folder.samples.is_file():
        return None
    return CalibrationSamples.load(folder.samples)


def calibrated_metrics(candidate: Candidate, calibration: Calibration) -> dict[str, Any]:
    """Return the validation scores of a checkpoint as they are with a calibration.

    Args:
        candidate: the run.
        calibration: what its file gets.

    Returns:
        Its own scores, without those that depend on the covariances if that is not its own
        calibration; the coverage of moving road users is counted anew if its validation samples
        are there.
    """
    metrics: dict[str, Any] = candidate.checkpoint["metrics"]
    if "model" not in metrics:
        return metrics
    own = calibration == own_calibration(candidate.checkpoint)
    model = metrics["model"] if own else _without_covariances(metrics["model"])
    samples = validation_samples(candidate.path)
    if samples is not None and "all" in model:
        scores = with_moving_scores(model["all"], samples.calibrated(calibration))
        model = {**model, "all": scores}
    return {**metrics, "model": model}


def _without_covariances(model: Mapping[str, Any]) -> dict[str, Any]:
    """Return a model's scores by protocol without those that another calibration changes."""
    return {
        protocol: {
            key: None if key in OF_COVARIANCES else value
            for key, value in scores.items()
            if not is_moving_score(key)
        }
        for protocol, scores in model.items()
    }


def check_coverage(metrics: Mapping[str, Any], *, force: bool = False) -> str:
    """Check the 90 % ellipses on the moving validation road users, 5 s ahead.

    Every road user counts, not every site: a site of three would count like one of a thousand.

    Args:
        metrics: validation scores with the calibration of the file.
        force: warn only.

    Returns:
        A warning, empty if there is nothing to say.

    Raises:
        ConfigurationError: too few or too many are inside, unless ``force``.
    """
    scores = metrics.get("model", {}).get("all", {})
    shares, agents = moving_coverage(scores), scores.get("moving_n")
    time_s, share = list(shares.items())[-1] if shares else (0.0, None)
    if agents is None or (share is None and agents > 0):
        return (
            "the 90 % ellipses were not checked, because the checkpoint does not say how many"
            " moving validation road users they hold"
        )
    if share is None or agents < LEAST_AGENTS:
        return (
            f"the validation has only {agents} predictions of moving road users that are known "
            f"{time_s:g} s ahead, expected at least {LEAST_AGENTS} to check the 90 % ellipses"
        )
    low, high = COVERAGE_LIMITS
    if low <= share <= high:
        return ""
    sentence = (
        f"the 90 % ellipses hold {share:.1%} of the moving validation road users {time_s:g} s "
        f"ahead ({agents} predictions), expected {low:.0%} to {high:.0%}"
    )
    if force:
        return sentence
    raise ConfigurationError(f"{sentence} (--force exports the model anyway)")
