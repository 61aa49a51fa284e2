# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training from its configuration to its last epoch.

Only ``mtpgo train`` imports this module, when it runs: Fabric comes with the extra ``training``
and takes seconds to load.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import torch
from lightning_fabric import Fabric
from torch_geometric.loader import DataLoader

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import only_writer
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.run_files import PLAN_FILE, RANGE_TEST_FILE
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.checkpointing import (
    all_recordings,
    resume_from,
    seen_in_validation,
    start_from,
)
from mtpgo_training.training.console import setting_text
from mtpgo_training.training.data_loading import Scenes, prepare_scenes, reweighted
from mtpgo_training.training.interruption import Interruption
from mtpgo_training.training.loop.device_setup import (
    fabric_for,
    is_first_process,
    quiet_fabric,
    require_own_processes,
    require_shares,
    torch_threads,
)
from mtpgo_training.training.loop.trained_effect import require_effect
from mtpgo_training.training.loop.trained_parts import train_only
from mtpgo_training.training.loop.training_loop import TrainingLoop
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.recipes.configured_origins import with_site_origins
from mtpgo_training.training.run_folder import Checkpoint, RunFolder, load_checkpoint
from mtpgo_training.training.run_loss import trainable_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import TrainingConfig, load_config
from mtpgo_training.training.trial.learning_rate_range import (
    RangeTest,
    learning_rate_range_test,
)
from mtpgo_training.training.trial.schedule_plan import SchedulePlan
from mtpgo_training.training.trial.time_limit import TimeLimit, plan_for_time, plan_text

_log = logging.getLogger("mtpgo")

STATISTICS_SCENES = 512
"""Scenes from which the scales of the network's inputs are taken (chosen)."""


def train(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    folder: RunFolder,
    *,
    resume: bool = False,
    init_from: Path | None = None,
    find_rate: bool = False,
    max_minutes: float | None = None,
    shorten: bool = False,
    started_s: float | None = None,
    cache: RecordingCache | None = None,
    scenes: Scenes | None = None,
    verbose: bool = False,
    progress: bool = False,
) -> TrainingRun:
    """Train a network.

    Args:
        config: the configuration.
        recordings: all recordings; the configuration says how they are split.
        folder: the run's folder, new unless ``resume``.
        resume: continue the run in the folder; its configuration and data must be the same.
        init_from: checkpoint of the same architecture whose weights to start from; a resumed run
            needs it only if it ended before its first checkpoint.
        find_rate: take the learning rate from a range test before the first epoch, see
            :mod:`mtpgo_training.training.trial.learning_rate_range`; a resumed run has its own.
        max_minutes: time limit (min). The current step is completed, and the weights are
            validated within the limit unless they were already.
        shorten: make the schedule of a new run fit into ``max_minutes``; a resumed run keeps the
            schedule that it has.
        started_s: ``time.monotonic()`` from which ``max_minutes`` counts, by default now.
        cache: keeps what is expensive to compute from the recordings.
        scenes: the scenes of these recordings with this configuration, if they were prepared.
        verbose: print the setting of the run and a line per epoch.
        progress: show progress bars.

    Returns:
        The run in its final state.

    Raises:
        ConfigurationError: the configuration, the split, the folder, a checkpoint or the device
            cannot be used.
    """
    limit = TimeLimit(max_minutes, started_s)
    prepare_process(torch_threads(config))
    plan_file = folder.path / PLAN_FILE
    if resume and plan_file.is_file():
        before, epochs = SchedulePlan.load(plan_file), config.optimisation.epochs
        if before.of_epochs not in (None, epochs):
            raise ConfigurationError(
                f"the configuration differs from that of {plan_file} in optimisation.epochs "
                f"({before.of_epochs} there, {epochs} here), expected the same to resume"
            )
        config = before.applied(config, recordings)
    if find_rate and resume and folder.config_file.is_file():
        stored = load_config(folder.config_file)
        config = _with_rate(config, stored.optimisation.learning_rate)
    config = with_site_origins(config, recordings)
    torch.manual_seed(config.seed)
    model = build_network(config.network, config.model, config.history, config.scene)
    train_only(model, config.optimisation.train_only)
    horizon = model.config.horizon_steps
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    run = TrainingRun(model, config)
    initial = load_checkpoint(init_from) if init_from else None
    checkpoint: Checkpoint | None = None
    if init_from and initial:
        start_from(run, initial, init_from)
    start_hash = weights_hash(run.average) if initial else ""
    if resume:
        folder.check_same(config, splits.describe(), start_hash)
        checkpoint = load_checkpoint(folder.last) if folder.last.exists() else None
    if checkpoint:
        resume_from(run, checkpoint, folder.last)

    fabric = fabric_for(config)
    run.is_global_zero = fabric.is_global_zero
    verbose, progress = verbose and run.is_global_zero, progress and run.is_global_zero
    creates_folder = run.is_global_zero and not resume
    if creates_folder:
        folder.require_new()
    if shorten and not resume:
        require_own_processes(fabric, config)
        if not run.is_global_zero:  # the first process made the plan before it started this one
            config = run.config = SchedulePlan.load(plan_file).applied(config, recordings)
    if scenes is None:
        if verbose:
            named = len(splits.train) + len(splits.validation)
            print(f"prepare    {named} recordings for training and validation", flush=True)
        scenes = prepare_scenes(config, splits, horizon, cache=cache, progress=progress)
    if not (checkpoint or initial):
        _fit_statistics(run, scenes)
    require_shares(fabric.world_size, config, len(scenes.training))
    require_effect(run, scenes.training)
    range_test: RangeTest | None = None
    if find_rate and not resume:
        range_test = _range_test(run, scenes, fabric)
        config = run.config = _with_rate(config, range_test.suggestion)
    plan: SchedulePlan | None = None
    epochs = config.optimisation.epochs
    if shorten and creates_folder and limit.is_set:
        if verbose:
            print("measure    the time of steps and of a validation, for the plan", flush=True)
        plan = plan_for_time(run, scenes, limit.left_s, fabric.world_size)
        plan = dataclasses.replace(plan, of_epochs=epochs)
        config = run.config = plan.applied(config, recordings)
        scenes = reweighted(scenes, splits, config)
        if not initial:
            _fit_statistics(run, scenes)  # as every process finds them, and a run of this config
    if creates_folder:
        files = {} if range_test is None else {RANGE_TEST_FILE: range_test.to_csv()}
        if plan is not None:
            files[PLAN_FILE] = plan.to_json()
        folder.start(config, splits.describe(), start_hash, files)
    if verbose:
        device, processes = fabric.device, fabric.world_size
        print(setting_text(run, scenes, splits, folder.path, device, processes), flush=True)
        seen = seen_in_validation(splits, initial) if initial else []
        if seen:
            _log.warning(
                "mtpgo: the weights that the run starts from were trained on %d of its %d "
                "validation recordings (%s): the best epoch and the calibration are chosen on "
                "what they have seen",
                len(seen),
                len(splits.validation),
                ", ".join(seen),
            )
        if range_test is not None:
            print(
                f"rate       {config.optimisation.learning_rate:.3g} from a range test of "
                f"{len(range_test.rates)} steps, see {folder.path / RANGE_TEST_FILE}",
                flush=True,
            )
        if plan is not None and max_minutes is not None:
            print(plan_text(plan, epochs, max_minutes), flush=True)
    if not run.finished:
        with quiet_fabric():
            fabric.launch()
        prepare_process(torch_threads(config))  # launching several processes sets torch's threads
        held = only_writer(folder.path) if run.is_global_zero else nullcontext()
        kept = checkpoint["splits"] if checkpoint else all_recordings(splits.describe(), initial)
        with held, Interruption() as interruption:
            if resume and run.is_global_zero:
                folder.restore_best()
            TrainingLoop(
                fabric,
                run,
                scenes,
                folder,
                splits=kept,
                checkpoint=checkpoint,
                interruption=interruption,
                limit=limit,
                verbose=verbose,
                progress=progress,
            ).fit()
    return run


def require_startable(
    config: TrainingConfig, folder: RunFolder, *, resume: bool, init_from: Path | None
) -> None:
    """Check what can be checked of a run before its recordings are read.

    Args:
        config: the configuration.
        folder: the run's folder.
        resume: continue the run in the folder.
        init_from: checkpoint whose weights to start from.

    Raises:
        ConfigurationError: network, losses, devices, folder or checkpoint cannot be used.
    """
    fabric_for(config)
    if resume:
        folder.require_run()
    elif is_first_process():
        folder.require_new()
    network = trainable_network(config)
    if init_from is not None:
        start_from(TrainingRun(network, config), load_checkpoint(init_from), init_from)


def _range_test(run: TrainingRun, scenes: Scenes, fabric: Fabric) -> RangeTest:
    """Return the range test of a run.

    Raises:
        ConfigurationError: there are several processes, which could find different rates.
    """
    if fabric.world_size > 1:
        raise ConfigurationError(
            f"--find-lr is given with {fabric.world_size} processes, expected one: find the rate "
            "with --devices 1 and give it as optimisation.learning_rate"
        )
    return learning_rate_range_test(run, scenes, fabric.device)


def _with_rate(config: TrainingConfig, rate: float) -> TrainingConfig:
    """Return the configuration with another learning rate."""
    options = dataclasses.replace(config.optimisation, learning_rate=rate)
    return dataclasses.replace(config, optimisation=options)


def _fit_statistics(run: TrainingRun, scenes: Scenes) -> None:
    """Set the scales of the network's inputs from random scenes of the first epoch."""
    order = torch.Generator().manual_seed(run.config.seed)
    single = scenes.training.without_pairs()
    loader = DataLoader(single, STATISTICS_SCENES, shuffle=True, generator=order)
    fields = dense(next(iter(loader)))
    run.model.fit_statistics(fields["x"], fields["valid"])
    run.model.fit_futures(fields["x"], fields["valid"], fields["target"], fields["weight"])
    run.average.load_state_dict(run.model.state_dict())
