# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The training loss of a batch: EWTA and likelihood, weighted by the schedule."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

from torch import Tensor
from torch_geometric.data import Batch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.training.losses.consistency_loss import NO_CONSISTENCY, ConsistencyTerm
from mtpgo_training.training.losses.ewta_loss import ewta_loss
from mtpgo_training.training.losses.gradient_accumulation import accumulated_loss, micro_batches
from mtpgo_training.training.losses.huber_terms import NO_TERMS, HuberTerms
from mtpgo_training.training.losses.likelihood_loss import negative_log_likelihood
from mtpgo_training.training.losses.schedules import LossWeights

Fields = Mapping[str, Tensor]
Likelihood = Callable[[Tensor, Tensor, Tensor, Tensor, Tensor], Tensor]


def training_loss(
    model: TrajectoryPredictor,
    fields: Fields,
    weights: LossWeights,
    *,
    huber: HuberTerms = NO_TERMS,
    likelihood: Likelihood = negative_log_likelihood,
    teacher_forcing: bool = False,
    summed: bool = False,
    consistency: ConsistencyTerm = NO_CONSISTENCY,
) -> Tensor:
    """Return the loss of a dense batch, a scalar.

    Args:
        model: the network.
        fields: a batch from :func:`mtpgo_training.scenes.scene_dataset.dense`.
        weights: of EWTA and NLL. Covariances are computed only if NLL has weight.
        huber: terms added to NLL, with weights relative to it; its delta is also used by EWTA.
        likelihood: the negative log-likelihood, one of :mod:`.likelihood_loss`.
        teacher_forcing: feed the observed states to the roll-out.
        summed: the EWTA loss is the paper's sum, see :func:`.ewta_loss.ewta_loss`; ``likelihood``
            has to be a sum, too.
        consistency: term added to NLL like ``huber``; it compares the prediction with a second
            one made a moment later.
    """
    states = model.config.state_size
    target, mask = fields["target"][..., :states], fields["weight"]
    with_covariance = weights.nll > 0.0
    log_weight, mean, covariance = model.roll_out(
        fields["x"],
        fields["valid"],
        fields["static"],
        initial_covariance=None,
        with_covariance=with_covariance,
        teacher=target if teacher_forcing else None,
        teacher_valid=mask > 0.0 if teacher_forcing else None,
        trails=fields.get("trails"),
    )
    loss = mean.new_zeros(())
    if weights.ewta > 0.0:
        loss = loss + weights.ewta * ewta_loss(
            mean, target, mask, weights.winners, huber.delta, summed=summed
        )
    if with_covariance:
        loss = loss + weights.nll * likelihood(log_weight, mean, covariance, target, mask)
        loss = loss + weights.nll * huber(log_weight, mean, target, mask)
        if consistency.weight > 0.0:
            later_log_weight, later_mean, _ = model.roll_out(
                fields["later_x"],
                fields["later_valid"],
                fields["static"],
                initial_covariance=None,
                with_covariance=False,
                teacher=None,
                teacher_valid=None,
                trails=fields.get("later_trails"),
            )
            term = consistency(log_weight, mean, later_log_weight, later_mean, fields)
            loss = loss + weights.nll * term
    return loss


def batch_loss(
    model: TrajectoryPredictor,
    batch: Batch,
    weights: LossWeights,
    *,
    huber: HuberTerms = NO_TERMS,
    likelihood: Likelihood = negative_log_likelihood,
    teacher_forcing: bool = False,
    summed: bool = False,
    consistency: ConsistencyTerm = NO_CONSISTENCY,
) -> Tensor:
    """Return :func:`training_loss` of a PyG batch, averaged over all its observed agent-steps.

    With ``summed``, averaged over its observed agents.

    Computed in micro-batches, see :mod:`mtpgo_training.training.losses.gradient_accumulation`.

    Args:
        model: the network.
        batch: graphs of :class:`mtpgo_training.scenes.scene_dataset.SceneDataset`.
        weights: this and the other arguments as in :func:`training_loss`.
        huber: see :func:`training_loss`.
        likelihood: see :func:`training_loss`.
        teacher_forcing: see :func:`training_loss`.
        summed: average over the agents instead of the agent-steps; see :func:`training_loss`.
        consistency: see :func:`training_loss`.
    """
    loss = functools.partial(
        training_loss,
        model,
        weights=weights,
        huber=huber,
        likelihood=likelihood,
        teacher_forcing=teacher_forcing,
        summed=summed,
        consistency=consistency,
    )
    return accumulated_loss(model, micro_batches(batch, summed), loss)
