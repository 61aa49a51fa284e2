# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a network predicts for the validation scenes of a site, kept to be scored several times."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.schema import BoolArray
from mtpgo_training.evaluation.scores.metrics import Array
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.validation import BATCH_SCENES


@dataclass(frozen=True)
class SitePredictions:
    """Predictions and truth of n agents, each at one instant, in the order of time.

    Attributes:
        log_weight: [n, M].
        mean: [n, M, H, 2] (m).
        covariance: [n, M, H, 2, 2] (m^2), as the network gives it.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
        constant_velocity: [n, H, 2] predicted by constant velocity (m).
        speed_mps: [n] at the time of the prediction (m/s).
    """

    log_weight: Array
    mean: Array
    covariance: Array
    truth: Array
    mask: BoolArray
    constant_velocity: Array
    speed_mps: Array

    def __len__(self) -> int:
        return len(self.mask)

    def select(self, rows: BoolArray | slice) -> SitePredictions:
        """Return some of the agents."""
        fields = dataclasses.fields(self)
        return SitePredictions(*(getattr(self, field.name)[rows] for field in fields))


@torch.no_grad()
def predict_site(model: TrajectoryPredictor, scenes: Sequence[Data]) -> SitePredictions:
    """Return what a network predicts for the agents of validation scenes.

    An agent counts once an instant, as its prediction would be published, if any of its future was
    observed.

    Args:
        model: the network, on the CPU.
        scenes: of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`, at least one.
    """
    model.eval()
    batches = []
    for batch in DataLoader(list(scenes), batch_size=BATCH_SCENES):
        fields = dense(batch)
        given = (fields["x"], fields["valid"], fields["static"], None, fields.get("trails"))
        log_weight, mean, covariance = model(*given)
        observed = fields["weight"] > 0.0
        rows = fields["primary"] & observed.any(dim=-1)
        batches.append(
            [
                value[rows].numpy()
                for value in (
                    log_weight,
                    mean[..., :2],
                    covariance[..., :2, :2],
                    fields["target"][..., :2],
                    observed,
                    fields["baselines"][..., BASELINES.index("cv"), :, :],
                    fields["x"][..., -1, 2:4].norm(dim=-1),
                )
            ]
        )
    return SitePredictions(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))
