# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What one batch teaches and what one batch shows: the steps, free of files, loops and devices."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import torch
from torch import Tensor

from models.config import ModelConfig
from models.mtp_go import MTPGO
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task import HistoryConfig, SceneConfig
from mtpgo_training.baselines import BASELINES
from mtpgo_training.losses import ewta, expected_huber, negative_log_likelihood
from mtpgo_training.schedule import Objective
from mtpgo_training.scorebook import ScoreBook

Fields = Mapping[str, Tensor]


def model_config(
    options: Mapping[str, object], history: HistoryConfig, scene: SceneConfig
) -> ModelConfig:
    """The network's configuration: ``options`` with the sizes that follow from the task.

    Raises:
        ConfigurationError: an option that the network does not know, or a value it refuses.
    """
    sizes = {
        "feature_size": len(scene.features),
        "static_size": len(scene.classes),
        "history_steps": history.steps,
        "dt_s": history.dt_s,
    }
    try:
        return ModelConfig.from_dict({**options, **sizes})
    except ValueError as error:
        raise ConfigurationError(f"model: {error}") from error


def training_loss(
    model: MTPGO,
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
        fields: a batch from :func:`mtpgo_training.dataset.dense`.
        objective: EWTA, NLL or their blend. The covariance is computed only where NLL counts.
        huber_delta: see :func:`mtpgo_training.losses.ewta`.
        mean_weight: share of :func:`mtpgo_training.losses.expected_huber` beside the likelihood.
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


@torch.no_grad()
def covariance_scale(model: MTPGO, batches: Iterable[Fields], level: float = 0.9) -> float:
    """The factor on the covariances at which ``level`` of the truths lie in their ellipses.

    Counted as the coverage metric counts: over an agent's observed steps first, then over the
    primary agents. Kept between 1/4 and 4: beyond that something else is wrong.

    Args:
        model: the network, its own ``covariance_scale`` being 1.
        batches: batches of :func:`mtpgo_training.dataset.validation_scenes`.
        level: the ellipses' probability.
    """
    squared, shares = [], []
    for fields in batches:
        log_weight, mean, covariance = model(fields["x"], fields["valid"], fields["static"])
        best = log_weight.argmax(dim=-1)[..., None, None, None]
        path = mean.gather(2, best.expand(-1, -1, 1, *mean.shape[3:])).squeeze(2)[..., :2]
        best = best.unsqueeze(-1).expand(-1, -1, 1, *covariance.shape[3:])
        spread = covariance.gather(2, best).squeeze(2)[..., :2, :2]
        offset = (fields["target"][..., :2] - path).unsqueeze(-1)
        distance = (offset.mT @ torch.linalg.inv(spread.double()).float() @ offset)[..., 0, 0]
        known = (fields["weight"] > 0.0) & fields["primary"].unsqueeze(-1)
        squared.append(distance[known])
        shares.append((known / known.sum(dim=-1, keepdim=True).clamp(min=1))[known])
    sorted_distance, order = torch.cat(squared).double().sort()
    share = torch.cat(shares).double()[order].cumsum(dim=0)
    reach = sorted_distance[int(torch.searchsorted(share, level * share[-1]))]
    return float((reach / (-2.0 * math.log(1.0 - level))).clamp(0.25, 4.0))


@torch.no_grad()
def validation_scores(model: MTPGO, batches: Iterable[Fields], scale: float = 1.0) -> ScoreBook:
    """Scores of the model and of the baselines on the same agents, by both protocols.

    Args:
        model: the network.
        batches: batches of :func:`mtpgo_training.dataset.validation_scenes`.
        scale: factor on the model's covariances, see :func:`covariance_scale`.
    """
    book = ScoreBook()
    for fields in batches:
        log_weight, mean, covariance = model(fields["x"], fields["valid"], fields["static"])
        observed = fields["weight"] > 0.0
        for protocol, chosen in (("all", fields["primary"]), ("centre", fields["centre"])):
            rows = chosen & observed.any(dim=-1)
            truth = fields["target"][rows][..., :2].numpy()
            mask = observed[rows].numpy()
            book.add(
                "model",
                protocol,
                mean=mean[rows][..., :2].numpy(),
                weight=log_weight[rows].exp().numpy(),
                covariance=scale * covariance[rows][..., :2, :2].numpy(),
                truth=truth,
                mask=mask,
            )
            paths = fields["baselines"][rows].numpy()  # [n, baselines, H, 2]
            for i, name in enumerate(BASELINES):
                book.add_path(name, protocol, path=paths[:, i], truth=truth, mask=mask)
    return book
