# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss by which a run is trained, as its configuration and its epoch determine it."""

from __future__ import annotations

import functools

from torch import Tensor, nn
from torch_geometric.data import Batch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.options import require
from mtpgo_training.scenes.pairs.scene_pair import steps_between_windows
from mtpgo_training.training.losses.batch_loss import Likelihood, batch_loss
from mtpgo_training.training.losses.consistency_loss import NO_CONSISTENCY, ConsistencyTerm
from mtpgo_training.training.losses.gradient_accumulation import accumulated_loss, micro_batches
from mtpgo_training.training.losses.huber_terms import HuberTerms
from mtpgo_training.training.losses.likelihood_loss import (
    mode_likelihood_loss,
    negative_log_likelihood,
    summed_negative_log_likelihood,
    trajectory_likelihood_loss,
)
from mtpgo_training.training.networks import build_network, family
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import TrainingConfig


def consistency_term(config: TrainingConfig, horizon_steps: int) -> ConsistencyTerm:
    """Return the consistency loss of a configuration.

    A network with an objective of its own has none.

    Raises:
        ConfigurationError: the windows are no whole number of steps of the horizon apart.
    """
    options = config.optimisation
    if options.consistency_weight == 0.0 or family(config.network).objective is not None:
        return NO_CONSISTENCY
    steps = steps_between_windows(config.data.stride_s, config.history.dt_s, horizon_steps)
    return ConsistencyTerm(options.consistency_weight, steps, options.huber_delta)


def trainable_network(config: TrainingConfig) -> TrajectoryPredictor:
    """Return a new network with random weights, of a configuration that it can be trained by.

    Raises:
        ConfigurationError: there is no such network, the losses do not fit it or the windows, or
            a run could end before the epochs that train its covariances.
    """
    patience, last = config.trainer.patience_epochs, config.optimisation.calibration_epochs
    require(
        "trainer.patience_epochs",
        patience,
        not (patience and last),
        f"0 with optimisation.calibration_epochs {last}, which a run that ends early goes without",
    )
    network = build_network(config.network, config.model, config.history, config.scene)
    consistency_term(config, network.config.horizon_steps)
    return network


class BatchLoss(nn.Module):
    """The loss of a batch as a module: DDP averages the gradients of what ``forward`` uses."""

    def __init__(self, run: TrainingRun) -> None:
        super().__init__()
        self.model = run.model
        self.run = run
        options = run.config.optimisation
        self.huber = HuberTerms(options.huber_delta, options.mean_weight, options.heaviest_weight)
        self.consistency = consistency_term(run.config, run.model.config.horizon_steps)
        self.likelihood: Likelihood = negative_log_likelihood
        if options.reduction == "sum":
            self.likelihood = summed_negative_log_likelihood
        elif options.likelihood == "trajectory":
            self.likelihood = functools.partial(
                trajectory_likelihood_loss, correlated_steps=options.correlated_steps
            )
        elif options.likelihood == "mode":
            self.likelihood = mode_likelihood_loss

    def forward(self, batch: Batch, teacher_forcing: bool) -> Tensor:
        """Return the loss of a batch with the weights of the run's present epoch."""
        options = self.run.config.optimisation
        calibrates = self.run.calibrates
        own = self.run.objective()
        if own is not None:
            loss = functools.partial(
                own.loss,
                self.model,
                progress=self.run.state.epoch / options.main_epochs,
                huber=self.huber,
            )
            return accumulated_loss(self.model, micro_batches(batch), loss)
        return batch_loss(
            self.model,
            batch,
            self.run.loss_weights(),
            # The means do not change while the covariances are trained.
            huber=HuberTerms(self.huber.delta) if calibrates else self.huber,
            likelihood=mode_likelihood_loss if calibrates else self.likelihood,
            teacher_forcing=teacher_forcing,
            summed=self.run.averages_agents,
            consistency=self.consistency if self.run.compares_windows else NO_CONSISTENCY,
        )
