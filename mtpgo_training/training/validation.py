# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a network shows on the validation scenes: scores, and how wide its ellipses should be."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.evaluation.scorebook import ScoreBook
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.training.batch_loss import Fields


@dataclass
class Reach:
    """How far from the heaviest mode the truths lie, in units of its covariance.

    Counted as the coverage metric counts: over an agent's observed steps first, then over the
    primary agents.
    """

    _squared: list[Tensor] = field(default_factory=list)
    _shares: list[Tensor] = field(default_factory=list)

    def add(self, fields: Fields, log_weight: Tensor, mean: Tensor, covariance: Tensor) -> None:
        """Take in a batch: what the network gives for ``fields``."""
        best = log_weight.argmax(dim=-1)[..., None, None, None]
        path = mean.gather(2, best.expand(-1, -1, 1, *mean.shape[3:])).squeeze(2)[..., :2]
        best = best.unsqueeze(-1).expand(-1, -1, 1, *covariance.shape[3:])
        spread = covariance.gather(2, best).squeeze(2)[..., :2, :2]
        offset = (fields["target"][..., :2] - path).unsqueeze(-1)
        distance = (offset.mT @ torch.linalg.inv(spread.double()).float() @ offset)[..., 0, 0]
        known = (fields["weight"] > 0.0) & fields["primary"].unsqueeze(-1)
        self._squared.append(distance[known])
        self._shares.append((known / known.sum(dim=-1, keepdim=True).clamp(min=1))[known])

    def merge(self, other: Reach) -> None:
        """Take in what another process has seen."""
        self._squared += other._squared
        self._shares += other._shares

    def scale(self, level: float = 0.9) -> float:
        """The factor on the covariances at which ``level`` of the truths lie in their ellipses.

        Kept between 1/4 and 4: beyond that something else is wrong.

        Args:
            level: the ellipses' probability.
        """
        distance, order = torch.cat(self._squared).double().sort()
        share = torch.cat(self._shares).double()[order].cumsum(dim=0)
        reach = distance[int(torch.searchsorted(share, level * share[-1]))]
        return float((reach / (-2.0 * math.log(1.0 - level))).clamp(0.25, 4.0))


@torch.no_grad()
def validate(
    model: TrajectoryPredictor, batches: Iterable[Fields], scale: float = 1.0
) -> tuple[ScoreBook, Reach]:
    """Scores of the model and of the baselines on the same agents, by both protocols.

    Args:
        model: the network, on any device.
        batches: batches of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`, in
            full precision.
        scale: factor on the model's covariances.
    """
    book, reach = ScoreBook(), Reach()
    device = next(model.parameters()).device
    for fields in batches:
        given = (fields[name].to(device) for name in ("x", "valid", "static"))
        log_weight, mean, covariance = (value.cpu() for value in model(*given))
        reach.add(fields, log_weight, mean, covariance)
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
    return book, reach
