# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Adapts a trained network to the recordings of a site: fine-tunes, averages, recalibrates.

The end of the recordings is left out of the training. The base model is scored there first; the
epoch, the share of the change that is kept, and the calibration are chosen there; and a result
that is worse there than the base model is refused by :func:`require_better`.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.calibration import Calibration
from mtpgo_training.adapt.adapt_options import FEWEST_AGENTS, AdaptOptions
from mtpgo_training.adapt.adaptation_scores import SiteScores, score_site
from mtpgo_training.adapt.covariance_training import (
    COVARIANCE_COST,
    covariance_config,
    covariance_epochs,
    train_covariances,
    trains_covariances,
)
from mtpgo_training.adapt.site_calibration import cross_calibrated, site_calibration
from mtpgo_training.adapt.site_predictions import SitePredictions, predict_site
from mtpgo_training.adapt.weight_averaging import SHARES, between
from mtpgo_training.calibration.calibration_report import with_moving_scores
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, Splits, split, window_s
from mtpgo_training.evaluation.training_overlap import is_known
from mtpgo_training.export.exporter import load_model
from mtpgo_training.export.model_calibration import own_calibration
from mtpgo_training.training.data_loading import Scenes, prepare_scenes
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.run_folder import Checkpoint, RunFolder, load_checkpoint
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import TrainerConfig, TrainingConfig
from mtpgo_training.training.trial.epoch_cost import measure_epoch
from mtpgo_training.training.validation import scene_batches, validate

SHARE_OF_TIME = 0.85
"""Share of the time that the epochs are planned to take; chosen: only a few steps are measured."""

EXPORT_S = 20.0
"""Time kept for writing and checking the model file (s); chosen: it takes some seconds."""


@dataclass(frozen=True)
class Adaptation:
    """A finished adaptation.

    Attributes:
        checkpoint: of the adapted network, as of a training, with ``adapted_from``.
        before: scores of the base model as it is.
        after: scores of the adapted model, whose calibration was fitted to other data.
        share: how much of the change of the weights was kept.
        epochs: completed epochs.
        wanted_epochs: most epochs that were asked for, more than fit into a short time.
        best_epoch: epoch whose weights were taken, counted from 1 and one more than ``epochs`` for
            those within the last, which was not completed; 0 for those within the first.
        train_minutes: duration of the recordings it was trained on (min).
        train_recordings: number of these recordings or parts of recordings.
        train_agents: number of road users in them.
        received_signal: the signal that ended the training early, if there was one.
    """

    checkpoint: Checkpoint
    before: SiteScores
    after: SiteScores
    share: float
    epochs: int
    wanted_epochs: int
    best_epoch: int
    train_minutes: float
    train_recordings: int
    train_agents: int
    received_signal: int | None


def adapt(
    base_path: Path,
    recordings: Sequence[NamedRecording],
    options: AdaptOptions,
    *,
    name: str,
    started_s: float | None = None,
    cache: RecordingCache | None = None,
    report: Callable[[str], None] = lambda line: None,
    progress: bool = False,
) -> Adaptation:
    """Adapt a network to the recordings of a site.

    Args:
        base_path: checkpoint or run folder of the model to begin with.
        recordings: of the site.
        options: see :class:`AdaptOptions`.
        name: of the adapted model.
        started_s: ``time.monotonic()`` from which ``options.minutes`` counts, now by default.
        cache: keeps what is expensive to compute from the recordings.
        report: called with a line of text at each stage.
        progress: show progress bars.

    Raises:
        ConfigurationError: the checkpoint or the recordings cannot be used, the recordings show
            too little, or the time is up before anything was trained.
    """
    started_s = time.monotonic() if started_s is None else started_s
    base = load_checkpoint(base_path)
    model, base_calibration = load_model(base), own_calibration(base)
    horizon = model.config.horizon_steps
    config = adapted_config(base, recordings, options, name)
    prepare_process(options.num_threads)
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    scenes = prepare_scenes(config, splits, horizon, cache=cache, progress=progress)
    for sentence in _overlap(base, splits):
        report(sentence)
    begin_s = time.monotonic()
    predictions = predict_site(model, scenes.validation)
    before = score_site(predictions.calibrated(base_calibration))
    validation_s = time.monotonic() - begin_s
    if before.moving < FEWEST_AGENTS:
        raise ConfigurationError(
            f"the last {options.validation_fraction:.0%} of the recordings show "
            f"{before.moving} moving agents, counted every {config.data.validation_stride_s:g} s, "
            f"expected at least {FEWEST_AGENTS} to compare models by"
        )
    report(
        f"begins with ADE {before.ade_m:.3f} m of moving road users "
        f"(constant velocity {before.constant_velocity_ade_m:.3f} m)"
    )
    # An epoch's two validations may begin just before the end; each share, the covariances and the
    # result have one.
    reserve_s = (4 + len(SHARES)) * validation_s + EXPORT_S
    end_s = started_s + 60.0 * options.minutes - reserve_s
    left_s = end_s - time.monotonic()
    if left_s <= 0.0:
        raise ConfigurationError(
            f"--minutes is {options.minutes:g}, expected at least "
            f"{options.minutes + 1.0 - left_s / 60.0:.0f}: reading and scoring took the time"
        )
    plan = _fitting(config, scenes, end_s)
    with tempfile.TemporaryDirectory() as folder:
        run = train(
            plan.config,
            recordings,
            RunFolder(Path(folder) / "run"),
            init_from=base_path,
            max_minutes=max(0.0, end_s - plan.covariances_s - time.monotonic()) / 60.0,
            scenes=scenes,
            progress=progress,
        )
        tuned = _tuned_weights(run, Path(folder) / "run")
    share, weights, predictions, after = _best_share(base, tuned, scenes, before)
    checkpoint = _checkpoint(base, run, splits, weights)
    received_signal = run.received_signal
    if plan.covariances is not None and received_signal is None:
        last = train_covariances(
            checkpoint,
            plan.covariances,
            recordings,
            scenes,
            max(0.0, end_s - time.monotonic()) / 60.0,
            progress=progress,
        )
        received_signal = last.received_signal
        checkpoint["average"] = _averaged(last)
        predictions = predict_site(load_model(checkpoint, calibrated=False), scenes.validation)
        after = score_site(cross_calibrated(predictions, base_calibration))
    checkpoint |= _calibrated(checkpoint, predictions.samples(), scenes, base_calibration)
    checkpoint["adapted_from"] = {
        "name": base["config"]["name"],
        "weights_sha256": weights_hash(load_model(base)),
        "share": share,
        "validation": {"before": before.to_dict(), "after": after.to_dict()},
    }
    trained = [item.recording for item in splits.train]
    return Adaptation(
        checkpoint,
        before,
        after,
        share,
        run.state.epoch,
        options.epochs,
        run.state.best_epoch if run.state.epoch else 0,
        sum(recording.duration_s for recording in trained) / 60.0,
        len(trained),
        sum(len(recording.track_id) for recording in trained),
        received_signal,
    )


def adapted_config(
    base: Checkpoint, recordings: Sequence[NamedRecording], options: AdaptOptions, name: str
) -> TrainingConfig:
    """Return the configuration of the training: the base model's task on other recordings.

    How the scenes are augmented stays as the base model was trained, but for the simulated
    trackers: the recordings of a user come from the tracker that the model will have.
    """
    config = from_dict(TrainingConfig, base["config"], "the checkpoint's configuration")
    data = dataclasses.replace(
        config.data,
        preset="",
        split="end",
        train=(),
        validation=(),
        test=(),
        validation_fraction=options.validation_fraction,
        test_fraction=0.0,
        tracker_share=0.0,
        validation_tracker=False,
        lane_change_share=0.0,
        centre_classes=(),
    )
    weight = min(1.0, options.epoch_scenes / _scenes_of(recordings, data, config, options))
    return dataclasses.replace(
        config,
        name=name,
        seed=options.seed,
        num_threads=options.num_threads,
        data=dataclasses.replace(data, source_weight={item.source: weight for item in recordings}),
        optimisation=dataclasses.replace(
            config.optimisation,
            epochs=options.epochs,
            warm_up_share=0.0,
            calibration_epochs=0,  # the covariances are trained afterwards
            consistency_weight=0.0,  # twice the steps in the same time
            train_only=(),  # of the base model's last stage
            learning_rate=options.learning_rate,
            learning_rate_schedule="cosine",
            keep="best",
        ),
        trainer=TrainerConfig(),
    )


@dataclass(frozen=True)
class _Plan:
    """What fits into the time.

    Attributes:
        config: of the training, with as many epochs as fit.
        covariances: of the training of the covariances that follows, None without one.
        covariances_s: time that is kept for it (s).
    """

    config: TrainingConfig
    covariances: TrainingConfig | None
    covariances_s: float


def _fitting(config: TrainingConfig, scenes: Scenes, end_s: float) -> _Plan:
    """Return the plan with as many epochs as take the time, at most those of the configuration.

    The learning rate falls over all epochs, so a training that the clock cuts off is not done.

    Args:
        config: of the training.
        scenes: its scenes.
        end_s: ``time.monotonic()`` at which the last validation is to be over.
    """
    network = build_network(config.network, config.model, config.history, config.scene)
    cost = measure_epoch(TrainingRun(network, config), scenes, time.monotonic)
    left_s = end_s - time.monotonic()
    covariances, covariances_s = None, 0.0
    if trains_covariances(config.network, network):
        epoch_s = COVARIANCE_COST * cost.likelihood
        # At most a quarter of the time: where it is short, the modes come first.
        fitting = int(0.25 * SHARE_OF_TIME * left_s / epoch_s)
        epochs = max(1, min(covariance_epochs(config, cost.scenes), fitting))
        covariances = covariance_config(config, network, epochs)
        covariances_s = min(epochs * epoch_s + cost.validation, 0.5 * left_s)
    options = config.optimisation
    left_s = SHARE_OF_TIME * left_s - covariances_s
    fitting = int(left_s / (cost.likelihood + cost.validation))
    epochs = max(1, min(options.epochs, fitting))
    planned = dataclasses.replace(config, optimisation=dataclasses.replace(options, epochs=epochs))
    return _Plan(planned, covariances, covariances_s)


def _scenes_of(
    recordings: Sequence[NamedRecording],
    data: DataConfig,
    config: TrainingConfig,
    options: AdaptOptions,
) -> float:
    """Return about how many training scenes the recordings have.

    A cover of the agents of an instant needs one graph at least, and somewhat more than they would
    fill. Chosen: 1.5 times as many; where most agents stand it was 1.0 times as many.
    """
    share = 1.0 - options.validation_fraction
    scenes = 1.0
    for item in recordings:
        recording = item.recording
        instants = recording.duration_s / data.stride_s
        agents = len(recording) / (recording.frame_rate * data.stride_s)
        scenes += share * max(instants, 1.5 * agents / (1 + config.scene.max_neighbours))
    return scenes


def _overlap(base: Checkpoint, splits: Splits) -> list[str]:
    """Return a sentence if the base model has seen recordings of the validation."""
    training = {"recordings": base["splits"]}
    seen = [
        item.name
        for item in splits.validation
        if is_known(training, item.recording.sha256, item.name)
    ]
    return [f"the model was already trained on {', '.join(seen)}"] if seen else []


def _tuned_weights(run: TrainingRun, folder: Path) -> dict[str, Tensor]:
    """Return the averaged weights of the best epoch, or of the first one if it was not completed.

    Raises:
        ConfigurationError: not a single step was completed.
    """
    if run.state.best_epoch:
        weights: dict[str, Tensor] = load_checkpoint(folder)["average"]
        return weights
    if not run.state.step:
        raise ConfigurationError(
            "the training ended before its first step, expected more time with --minutes"
        )
    return _averaged(run)


def _averaged(run: TrainingRun) -> dict[str, Tensor]:
    """Return the averaged weights of a run in its final state."""
    return {name: value.cpu() for name, value in run.average.state_dict().items()}


def _best_share(
    base: Checkpoint, tuned: dict[str, Tensor], scenes: Scenes, before: SiteScores
) -> tuple[float, dict[str, Tensor], SitePredictions, SiteScores]:
    """Return the share of the change that is best, the weights, predictions and scores with it.

    The best one has the smallest ADE of moving agents of those whose likelihood is no worse than
    before, or of all if there is none.
    """
    found = []
    for share in SHARES:
        weights = between(base["average"], tuned, share)
        model = load_model({**base, "average": weights}, calibrated=False)
        predictions = predict_site(model, scenes.validation)
        scores = score_site(cross_calibrated(predictions, own_calibration(base)))
        key = (scores.nll > before.nll, scores.ade_m, share)
        found.append((key, weights, predictions, scores))
    key, weights, predictions, scores = min(found, key=lambda entry: entry[0])
    return key[-1], weights, predictions, scores


def _checkpoint(
    base: Checkpoint, run: TrainingRun, splits: Splits, weights: dict[str, Tensor]
) -> Checkpoint:
    """Return the checkpoint of the adapted network, without its calibration and metrics.

    Its recordings are those of the base model and of the adaptation: the network has seen both.
    """
    return {
        "config": dataclasses.asdict(run.config),
        "network": run.config.network,
        "model_config": base["model_config"],
        "average": {name: value.clone() for name, value in weights.items()},
        "epoch": run.state.epoch,
        "step": run.state.step,
        "splits": [*splits.describe(), *base["splits"]],
    }


def _calibrated(
    checkpoint: Checkpoint, samples: CalibrationSamples, scenes: Scenes, base: Calibration
) -> Checkpoint:
    """Return calibration and metrics of a checkpoint on the validation part.

    Args:
        checkpoint: of the adapted network.
        samples: of it on the validation part, without a calibration.
        scenes: of the site.
        base: calibration of the base model.
    """
    calibration = site_calibration(samples, base)
    batches = scene_batches(scenes.validation, samples.sites)
    scored, _ = validate(load_model(checkpoint), batches, calibration, sites=samples.sites)
    averages = scored.averages()
    scores = averages["model"]
    scores["all"] = with_moving_scores(scores["all"], samples.calibrated(calibration))
    return {"calibration": dataclasses.asdict(calibration), "metrics": averages}
