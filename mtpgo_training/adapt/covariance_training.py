# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The last part of an adaptation: only the covariances are trained.

In the likelihood of a mixture a mode's covariance has to explain only the truths that this mode is
responsible for, so the adaptation shrinks the covariances. A calibration fitted to the site widens
them again, but only those of road users that the validation part shows often enough: the others
keep the factors of the base model, which are for covariances trained like this (docs/design.md,
"Covariances last").
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.data_loading import Scenes
from mtpgo_training.training.loop.trained_parts import calibrated_parts
from mtpgo_training.training.networks import family
from mtpgo_training.training.run_folder import Checkpoint, RunFolder, write_checkpoint
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import TrainingConfig

COVARIANCE_STEPS = 60
"""Steps in which only the covariances are trained, rounded up to whole epochs; chosen: about as
many as the recipe of the shipped model has in its last epoch."""

COVARIANCE_COST = 0.5
"""Time of such a step as a share of that of another one; measured."""


def trains_covariances(network: str, model: TrajectoryPredictor) -> bool:
    """Return whether the covariances of a network can be trained alone.

    Args:
        network: name of its family.
        model: the network.
    """
    return family(network).objective is None and bool(calibrated_parts(model))


def covariance_epochs(config: TrainingConfig, scenes: int) -> int:
    """Return the epochs that have :data:`COVARIANCE_STEPS` steps, at least one.

    Args:
        config: of the adaptation.
        scenes: number of scenes of an epoch.
    """
    wanted = COVARIANCE_STEPS * config.optimisation.batch_scenes
    return max(1, math.ceil(wanted / max(1, scenes)))


def covariance_config(
    config: TrainingConfig, model: TrajectoryPredictor, epochs: int
) -> TrainingConfig:
    """Return the configuration that trains only the covariances, each mode on its own.

    Args:
        config: of the adaptation.
        model: the network.
        epochs: their number; the last one is validated.
    """
    options = config.optimisation
    return dataclasses.replace(
        config,
        optimisation=dataclasses.replace(
            options,
            epochs=epochs,
            likelihood="mode",
            mean_weight=0.0,
            heaviest_weight=0.0,
            train_only=tuple(calibrated_parts(model)),
            learning_rate=options.calibration_learning_rate,
            keep="last",
        ),
        trainer=dataclasses.replace(config.trainer, validate_every_epochs=epochs),
    )


def train_covariances(
    checkpoint: Checkpoint,
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    scenes: Scenes,
    max_minutes: float,
    *,
    progress: bool,
) -> TrainingRun:
    """Train the covariances of a network on a site.

    Args:
        checkpoint: of the network.
        config: of :func:`covariance_config`.
        recordings: of the site.
        scenes: of these recordings.
        max_minutes: time limit (min).
        progress: show a bar.

    Returns:
        The run in its final state.
    """
    with tempfile.TemporaryDirectory() as folder:
        start = Path(folder) / "adapted.ckpt"
        write_checkpoint(start, {**checkpoint, "metrics": {}})  # of no use there
        return train(
            config,
            recordings,
            RunFolder(Path(folder) / "run"),
            init_from=start,
            max_minutes=max_minutes,
            scenes=scenes,
            progress=progress,
        )
