# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Validation: the scores of a network, and the factor that calibrates its covariances."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.evaluation.scores.agent_scores import score_agents, score_paths
from mtpgo_training.evaluation.scores.score_table import Averages, ScoreTable
from mtpgo_training.scenes.kinematic_baselines import BASELINES
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.losses.batch_loss import Fields
from mtpgo_training.training.run_state import Row, TrainingRun

BATCH_SCENES = 64
"""Scenes in a batch; it fits into memory without gradients, whatever the training batch is."""

EWTA_PENALTY_M = 1e3
"""Added to the ADE of epochs with an EWTA loss, more than any ADE: they are the best only until
the first epoch trained on the likelihood alone (m)."""

LOGGED_SCORES = ("ade", "fde", "mr", "anll", "min_ade", "coverage_90")
"""Validation scores in the log."""


@dataclass
class CovarianceCalibration:
    """Squared Mahalanobis distances of the truth from the heaviest mode.

    Weighted as in the coverage metric: an average over an agent's observed steps first, then over
    the primary agents.
    """

    _distances: list[Tensor] = field(default_factory=list)
    _shares: list[Tensor] = field(default_factory=list)

    def add(self, fields: Fields, log_weight: Tensor, mean: Tensor, covariance: Tensor) -> None:
        """Add a batch: the network's output for ``fields``."""
        best = log_weight.argmax(dim=-1)[..., None, None, None]
        path = mean.gather(2, best.expand(-1, -1, 1, *mean.shape[3:])).squeeze(2)[..., :2]
        best = best.unsqueeze(-1).expand(-1, -1, 1, *covariance.shape[3:])
        spread = covariance.gather(2, best).squeeze(2)[..., :2, :2]
        offset = (fields["target"][..., :2] - path).unsqueeze(-1)
        distance = (offset.mT @ torch.linalg.inv(spread.double()).float() @ offset)[..., 0, 0]
        known = (fields["weight"] > 0.0) & fields["primary"].unsqueeze(-1)
        self._distances.append(distance[known])
        self._shares.append((known / known.sum(dim=-1, keepdim=True).clamp(min=1))[known])

    def merge(self, other: CovarianceCalibration) -> None:
        """Add the distances of another process."""
        self._distances += other._distances
        self._shares += other._shares

    def scale(self, level: float = 0.9) -> float:
        """Return the factor on the covariances at which ``level`` of the truth is covered.

        Limited to 1/4 to 4: a larger correction would hide a different problem.

        Args:
            level: probability of the ellipses.
        """
        distance, order = torch.cat(self._distances).double().sort()
        share = torch.cat(self._shares).double()[order].cumsum(dim=0)
        quantile = distance[int(torch.searchsorted(share, level * share[-1]))]
        # -2 log(1 - level) is the quantile of the chi-square distribution with two degrees.
        return float((quantile / (-2.0 * math.log(1.0 - level))).clamp(0.25, 4.0))


@torch.no_grad()
def validate(
    model: TrajectoryPredictor, batches: Iterable[Fields], scale: float = 1.0
) -> tuple[ScoreTable, CovarianceCalibration]:
    """Return the scores of the model and of the baselines on the same agents, by both protocols.

    Args:
        model: the network, on any device.
        batches: dense batches of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`, in
            full precision.
        scale: factor on the model's covariances.
    """
    scores, calibration = ScoreTable(), CovarianceCalibration()
    device = next(model.parameters()).device
    for fields in batches:
        given = [fields[name].to(device) for name in ("x", "valid", "static")]
        trails = fields["trails"].to(device) if "trails" in fields else None
        log_weight, mean, covariance = (value.cpu() for value in model(*given, None, trails))
        calibration.add(fields, log_weight, mean, covariance)
        observed = fields["weight"] > 0.0
        for protocol, chosen in (("all", fields["primary"]), ("centre", fields["centre"])):
            rows = chosen & observed.any(dim=-1)
            truth = fields["target"][rows][..., :2].numpy()
            mask = observed[rows].numpy()
            scored = score_agents(
                mean[rows][..., :2].numpy(),
                log_weight[rows].exp().numpy(),
                scale * covariance[rows][..., :2, :2].numpy(),
                truth,
                mask,
            )
            scores.add("model", protocol, scored)
            paths = fields["baselines"][rows].numpy()  # [n, baselines, H, 2]
            for i, name in enumerate(BASELINES):
                scores.add(name, protocol, score_paths(paths[:, i], truth, mask))
    return scores, calibration


def validate_epoch(
    run: TrainingRun, scenes: Sequence[Data], rank: int, processes: int
) -> tuple[Row, bool]:
    """Validate the averaged weights, and keep their scores if they are the best so far.

    The best epoch is the one with the lowest ADE among those trained on the likelihood alone; with
    ``optimisation.keep: last`` it is the last one.

    Args:
        run: the run at the end of an epoch that is not in the log yet.
        scenes: the validation scenes, of which each process computes its share.
        rank: number of this process.
        processes: number of processes.

    Returns:
        The validation's columns of the log, and whether the epoch is the best so far.
    """
    state = run.state
    averages, calibration = _validate_together(run, scenes[rank::processes], processes)
    criterion = averages["model"]["all"]["ade"]
    assert criterion is not None, "no agent of the validation scenes was observed"
    if run.loss_weights().ewta > 0.0:
        criterion += EWTA_PENALTY_M
    better = criterion < state.best or run.config.optimisation.keep == "last"
    if better:
        state.best, state.best_epoch = criterion, state.epoch + 1
        state.scale = calibration.scale()
        calibrated, _ = _validate_together(run, scenes[rank::processes], processes, state.scale)
        state.metrics = calibrated
    return _columns(averages), better


def _validate_together(
    run: TrainingRun, scenes: Sequence[Data], processes: int, scale: float = 1.0
) -> tuple[Averages, CovarianceCalibration]:
    """Return what all processes find together, each with its own ``scenes``."""
    batches = (dense(batch) for batch in DataLoader(scenes, batch_size=BATCH_SCENES))
    scores, calibration = validate(run.average.eval(), batches, scale)
    if processes > 1:
        shares: list[Any] = [None] * processes
        torch.distributed.all_gather_object(shares, (scores, calibration))
        scores, calibration = ScoreTable(), CovarianceCalibration()
        for other_scores, other_calibration in shares:
            scores.merge(other_scores)
            calibration.merge(other_calibration)
    return scores.averages(), calibration


def _columns(averages: Averages) -> Row:
    row: Row = {}
    for protocol in ("all", "centre"):
        for key in LOGGED_SCORES:
            row[f"{protocol}_{key}"] = _rounded(averages["model"][protocol][key])
    for name in ("cv", "ca"):
        row[f"{name}_all_ade"] = _rounded(averages[name]["all"]["ade"])
        row[f"{name}_centre_ade"] = _rounded(averages[name]["centre"]["ade"])
    return row


def _rounded(value: float | None) -> float:
    return math.nan if value is None else round(value, 4)
