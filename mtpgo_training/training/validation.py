# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Validation: the scores of a network, and the calibration of its output."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.calibrated_prediction import calibrated_covariances, calibrated_weights
from mtpgo_core.prediction.paths.mode_spread import with_least_spread
from mtpgo_core.task.calibration import Calibration
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.calibration.calibration_report import moving_scores, with_moving_scores
from mtpgo_training.calibration.calibration_samples import CalibrationSamples, merge_samples
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
"""Validation scores in the log, besides the coverage of moving road users."""


@torch.no_grad()
def predict_batch(model: TrajectoryPredictor, fields: Fields) -> tuple[Tensor, Tensor, Tensor]:
    """Return the output of a network for a dense batch, on the CPU, modes as far apart as served.

    Args:
        model: the network, on any device.
        fields: from :func:`mtpgo_training.scenes.scene_dataset.dense`.
    """
    device = next(model.parameters()).device
    given = [fields[name].to(device) for name in ("x", "valid", "static")]
    trails = fields["trails"].to(device) if "trails" in fields else None
    log_weight, mean, covariance = model(*given, None, trails)
    log_weight, mean, covariance = log_weight.cpu(), mean.cpu(), covariance.cpu()
    moved = with_least_spread(
        mean.flatten(0, 1).numpy(),
        log_weight.flatten(0, 1).double().exp().numpy(),
        covariance[..., :2, :2].flatten(0, 1).numpy(),
        model.config.least_mode_spread,
        model.config.dt_s,
    )
    return log_weight, torch.from_numpy(moved).view_as(mean), covariance


@torch.no_grad()
def validate(
    model: TrajectoryPredictor,
    batches: Iterable[Fields],
    calibration: Calibration = Calibration(),  # noqa: B008  frozen
    *,
    sites: Sequence[str] = ("",),
) -> tuple[ScoreTable, CalibrationSamples]:
    """Return the scores of the model and of the baselines on the same agents, by both protocols.

    Args:
        model: the network, on any device.
        batches: dense batches of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`, in
            full precision; with ``site`` [B, N], the position of each agent's site in ``sites``,
            where there are several.
        calibration: of the model's output, in the scores.
        sites: names of the sites.

    Returns:
        The scores, and the samples for a calibration of the agents of protocol ``all``: of the
        model as it is, whatever ``calibration`` is.
    """
    scores, samples = ScoreTable(), []
    for fields in batches:
        log_weight, mean, covariance = predict_batch(model, fields)
        observed = fields["weight"] > 0.0
        for protocol, chosen in (("all", fields["primary"]), ("centre", fields["centre"])):
            rows = chosen & observed.any(dim=-1)
            truth = fields["target"][rows][..., :2].numpy()
            mask = observed[rows].numpy()
            position = mean[rows][..., :2].numpy()
            weight = log_weight[rows].exp().numpy()
            spread = covariance[rows][..., :2, :2].numpy()
            group = fields["group"][rows].numpy()
            if protocol == "all":
                samples.append(
                    CalibrationSamples.of(
                        position,
                        weight,
                        spread,
                        truth,
                        mask,
                        group=group,
                        step_s=model.config.dt_s,
                        sites=sites,
                        site=fields["site"][rows].numpy() if "site" in fields else 0,
                    )
                )
            half = np.ones(mask.shape)
            if not calibration.is_none:
                half = calibration.sigma_factor_50_table[group]
                weight = calibrated_weights(weight, group, calibration)
                spread = calibrated_covariances(spread, group, calibration)
            scores.add(
                "model", protocol, score_agents(position, weight, spread, truth, mask, half)
            )
            paths = fields["baselines"][rows].numpy()  # [n, baselines, H, 2]
            for i, name in enumerate(BASELINES):
                scores.add(name, protocol, score_paths(paths[:, i], truth, mask))
    return scores, merge_samples(samples)


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

    Raises:
        ConfigurationError: the training has diverged.
    """
    state = run.state
    averages, samples = _validate_together(run, scenes, rank, processes)
    criterion = averages["model"]["all"]["ade"]
    if criterion is None:
        rate = run.config.optimisation.learning_rate
        raise ConfigurationError(
            f"the predictions are not finite after epoch {state.epoch + 1}, the training has "
            f"diverged, expected a learning rate below {rate:g} (optimisation.learning_rate)"
        )
    if run.loss_weights().ewta > 0.0:
        criterion += EWTA_PENALTY_M
    keep_last = run.config.optimisation.keep == "last" or run.calibrates
    better = criterion < state.best or keep_last
    if better:
        state.best, state.best_epoch = criterion, state.epoch + 1
        calibrated_output = run.config.optimisation.calibrated
        calibration = fit_calibration(samples) if calibrated_output else Calibration()
        calibrated, _ = _validate_together(run, scenes, rank, processes, calibration)
        scores = calibrated["model"]
        scores["all"] = with_moving_scores(scores["all"], samples.calibrated(calibration))
        state.calibration = dataclasses.asdict(calibration)
        state.metrics = calibrated
        run.samples = samples
    return _columns(averages, moving_scores(samples)), better


def _validate_together(
    run: TrainingRun,
    scenes: Sequence[Data],
    rank: int,
    processes: int,
    calibration: Calibration = Calibration(),  # noqa: B008  frozen
) -> tuple[Averages, CalibrationSamples]:
    """Return what all processes find together, each with its share of the scenes.

    There may be fewer scenes than processes.
    """
    sites = sorted({scene.site for scene in scenes})
    mine, share = scenes[rank::processes], None
    if mine:
        batches = scene_batches(mine, sites)
        share = validate(run.average.eval(), batches, calibration, sites=sites)
    shares: list[Any] = [share]
    if processes > 1:
        shares = [None] * processes
        torch.distributed.all_gather_object(shares, share)
    given = [one for one in shares if one is not None]
    scores = given[0][0]
    for other, _ in given[1:]:
        scores.merge(other)
    return scores.averages(), merge_samples([samples for _, samples in given])


def scene_batches(scenes: Sequence[Data], sites: Sequence[str]) -> Iterator[Fields]:
    """Yield dense batches of validation scenes.

    Args:
        scenes: of :func:`mtpgo_training.scenes.scene_dataset.validation_scenes`.
        sites: names of all sites; ``site`` [B, N] is the position of each agent's site among them.
    """
    for batch in DataLoader(scenes, batch_size=BATCH_SCENES):
        fields = dense(batch)
        site = torch.tensor([sites.index(name) for name in batch.site])
        yield {**fields, "site": site[:, None].expand(fields["primary"].shape)}


def _columns(averages: Averages, moving: Mapping[str, float | None]) -> Row:
    row: Row = {}
    for protocol in ("all", "centre"):
        for key in LOGGED_SCORES:
            row[f"{protocol}_{key}"] = _rounded(averages["model"][protocol][key])
    for key, value in moving.items():
        row[f"all_{key}"] = _rounded(value)
    for name in ("cv", "ca"):
        row[f"{name}_all_ade"] = _rounded(averages[name]["all"]["ade"])
        row[f"{name}_centre_ade"] = _rounded(averages[name]["centre"]["ade"])
    return row


def _rounded(value: float | None) -> float:
    return math.nan if value is None else round(value, 4)
