# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checks that the parts that are trained take part in the losses that they are trained by."""

from __future__ import annotations

import copy

import torch
from torch_geometric.loader import DataLoader

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.scenes.scene_dataset import SceneDataset
from mtpgo_training.training.loop.trained_parts import train_only
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import TrainingRun


def require_effect(run: TrainingRun, scenes: SceneDataset) -> None:
    """Check that the loss of each epoch depends on a part of the network that is trained.

    The EWTA loss, for instance, depends neither on the covariances nor on the mode weights. Each
    loss of the schedule is computed once, on one scene.

    Args:
        run: the run, which is not changed.
        scenes: those it is trained on.

    Raises:
        ConfigurationError: the loss of an epoch depends on none of ``optimisation.train_only``.
    """
    options = run.config.optimisation
    if not options.train_only:
        return
    trial = TrainingRun(copy.deepcopy(run.model), run.config)
    seen = set()
    with torch.random.fork_rng(devices=[]):
        for epoch in range(options.main_epochs):
            weights = trial.loss_weights(epoch)
            terms = (weights.ewta > 0.0, weights.nll > 0.0)
            if terms in seen:
                continue
            seen.add(terms)
            trial.state.epoch = epoch
            train_only(trial.model, options.train_only)
            loss = BatchLoss(trial)(next(iter(DataLoader(scenes, 1))), teacher_forcing=False)
            if not loss.requires_grad:
                raise ConfigurationError(
                    f"optimisation.train_only is {list(options.train_only)}, on which the loss of "
                    f"epoch {epoch + 1}, {weights.name}, does not depend, expected other parts, "
                    "or optimisation.warm_up_share 0 for those of covariances and mode weights"
                )
