# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a network predicts for the validation scenes of a site, kept to be scored several times."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch_geometric.data import Data

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.prediction.calibrated_prediction import calibrated_covariances, calibrated_weights
from mtpgo_core.quality.metrics import Array
from mtpgo_core.schema import BoolArray, Float64Array, IndexArray
from mtpgo_core.task.calibration import Calibration, GroupArray
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.training.validation import predict_batch, scene_batches

_ARRAYS = (
    "weight",
    "mean",
    "covariance",
    "truth",
    "mask",
    "constant_velocity",
    "group",
    "site",
)


@dataclass(frozen=True)
class SitePredictions:
    """Predictions and truth of n agents, each at one instant, in the order of time.

    Attributes:
        weight: [n, M].
        mean: [n, M, H, 2] (m).
        covariance: [n, M, H, 2, 2] (m^2), as the network gives it.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
        constant_velocity: [n, H, 2] predicted by constant velocity (m).
        group: [n] calibrated group, which says what moves, see
            :func:`mtpgo_core.task.calibration.calibration_groups`.
        site: [n] position of each agent's site in ``sites``.
        sites: names of the sites.
        step_s: time between two horizon steps (s).
    """

    weight: Float64Array
    mean: Array
    covariance: Float64Array
    truth: Array
    mask: BoolArray
    constant_velocity: Array
    group: GroupArray
    site: NDArray[np.int64]
    sites: tuple[str, ...]
    step_s: float

    def __len__(self) -> int:
        return len(self.mask)

    def select(self, rows: IndexArray) -> SitePredictions:
        """Return some of the agents."""
        arrays = {name: getattr(self, name)[rows] for name in _ARRAYS}
        return dataclasses.replace(self, **arrays)

    def samples(self) -> CalibrationSamples:
        """Return what a calibration is fitted to."""
        return CalibrationSamples.of(
            self.mean,
            self.weight,
            self.covariance,
            self.truth,
            self.mask,
            group=self.group,
            step_s=self.step_s,
            sites=self.sites,
            site=self.site,
        )

    def calibrated(self, calibration: Calibration) -> SitePredictions:
        """Return the predictions with calibrated weights and covariances."""
        if calibration.is_none:
            return self
        return dataclasses.replace(
            self,
            weight=calibrated_weights(self.weight, self.group, calibration),
            covariance=calibrated_covariances(self.covariance, self.group, calibration),
        )


def predict_site(model: TrajectoryPredictor, scenes: Sequence[Data]) -> SitePredictions:
    """Return what a network predicts for the agents of validation scenes.

    An agent counts once an instant, as its prediction would be published, if any of its future was
    observed.

    Args:
        model: the network, on any device.
        scenes: of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`, at least one.
    """
    model.eval()
    sites = sorted({scene.site for scene in scenes})
    batches = []
    for fields in scene_batches(scenes, sites):
        log_weight, mean, covariance = predict_batch(model, fields)
        observed = fields["weight"] > 0.0
        rows = fields["primary"] & observed.any(dim=-1)
        batches.append(
            [
                value[rows].numpy()
                for value in (
                    log_weight.double().exp(),
                    mean[..., :2],
                    covariance[..., :2, :2].double(),
                    fields["target"][..., :2],
                    observed,
                    fields["baselines"][..., BASELINES.index("cv"), :, :],
                    fields["group"],
                    fields["site"],
                )
            ]
        )
    columns = zip(_ARRAYS, zip(*batches, strict=True), strict=True)
    arrays: dict[str, Any] = {name: np.concatenate(parts) for name, parts in columns}
    return SitePredictions(**arrays, sites=tuple(sites), step_s=model.config.dt_s)
