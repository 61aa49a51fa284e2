# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What one batch teaches, free of files, loops and devices."""

from __future__ import annotations

import functools
from collections.abc import Mapping

from torch import Tensor
from torch_geometric.data import Batch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.training.losses import ewta, expected_huber, negative_log_likelihood
from mtpgo_training.training.microbatch import grouped_loss, groups_of
from mtpgo_training.training.objective import Objective

Fields = Mapping[str, Tensor]


def training_loss(
    model: TrajectoryPredictor,
    fields: Fields,
    objective: Objective,
    *,
    huber_delta: float,
    mean_weight: float = 0.0,
    teacher: bool = False,
) -> Tensor:
    """The loss of a batch under an objective of algorithm 1, a scalar.

    Args:
        model: the network.
        fields: a batch from :func:`mtpgo_training.scenes.scene_dataset.dense`.
        objective: EWTA, NLL or their blend. The covariance is computed only where NLL counts.
        huber_delta: see :func:`mtpgo_training.training.losses.ewta`.
        mean_weight: share of :func:`mtpgo_training.training.losses.expected_huber` beside
            the likelihood.
        teacher: feed the observed states to the roll-out.
    """
    states = model.config.state_size
    target, weight = fields["target"][..., :states], fields["weight"]
    with_covariance = objective.nll_weight > 0.0
    log_weight, mean, covariance = model.roll_out(
        fields["x"],
        fields["valid"],
        fields["static"],
        None,
        with_covariance,
        target if teacher else None,
        weight > 0.0 if teacher else None,
    )
    loss = mean.new_zeros(())
    if objective.ewta_weight > 0.0:
        loss = loss + objective.ewta_weight * ewta(
            mean, target, weight, objective.winners, huber_delta
        )
    if with_covariance:
        loss = loss + objective.nll_weight * negative_log_likelihood(
            log_weight, mean, covariance, target, weight
        )
        if mean_weight > 0.0:
            loss = loss + objective.nll_weight * mean_weight * expected_huber(
                log_weight, mean, target, weight, huber_delta
            )
    return loss


def batch_loss(
    model: TrajectoryPredictor,
    batch: Batch,
    objective: Objective,
    *,
    huber_delta: float,
    mean_weight: float = 0.0,
    teacher: bool = False,
) -> Tensor:
    """:func:`training_loss` of a PyG batch, averaged over all its observed agent-steps.

    Computed group by group, see :mod:`mtpgo_training.training.microbatch`.

    Args:
        model: the network.
        batch: graphs of :class:`mtpgo_training.scenes.scene_dataset.SceneDataset`.
        objective: as in :func:`training_loss`, like the rest.
        huber_delta: see there.
        mean_weight: see there.
        teacher: see there.
    """
    loss = functools.partial(
        training_loss,
        model,
        objective=objective,
        huber_delta=huber_delta,
        mean_weight=mean_weight,
        teacher=teacher,
    )
    return grouped_loss(model, groups_of(batch), loss)
