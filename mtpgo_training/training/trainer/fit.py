# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A whole run: from recordings and a configuration to a folder with checkpoints."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import lightning
import torch
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch.loggers import TensorBoardLogger
from torch_geometric.loader import DataLoader

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.run_folder import Checkpoint, RunFolder, load_checkpoint
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.trainer.checkpointing import Keeper, restore, start_from
from mtpgo_training.training.trainer.console import Narrator
from mtpgo_training.training.trainer.data_module import SceneLoaders, Scenes, prepare_scenes
from mtpgo_training.training.trainer.epoch_validation import epochs_without_better
from mtpgo_training.training.trainer.interruption import Stopper
from mtpgo_training.training.trainer.run_state import RunState
from mtpgo_training.training.trainer.training_module import TrainingModule
from mtpgo_training.training.training_config import TrainingConfig

STATISTICS_SCENES = 512
"""Scenes from which the network's input scales are taken."""


def train(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    folder: RunFolder,
    *,
    resume: bool = False,
    init_from: Path | None = None,
    max_minutes: float | None = None,
    cache: RecordingCache | None = None,
    talk: bool = False,
    progress: bool = False,
) -> TrainingModule:
    """Train a network.

    Args:
        config: the configuration.
        recordings: all recordings; the configuration says which teach.
        folder: the run's folder, new unless ``resume``.
        resume: go on with the run in the folder; its configuration and data must be the same.
        init_from: checkpoint of the same architecture whose weights to start from.
        max_minutes: stop cleanly after this long.
        cache: where what is costly to compute from the recordings is kept.
        talk: print what the run is and a line an epoch.
        progress: show progress bars.

    Returns:
        The module as it is at the end, its callbacks beside it in ``module.trainer``.

    Raises:
        ConfigurationError: the configuration, the split, the folder, a checkpoint or the device
            cannot be used.
    """
    prepare_process(_threads(config))
    torch.manual_seed(config.seed)
    network = build_network(config.network, config.model, config.history, config.scene)
    guard_s = window_s(config.history, network.config.horizon_steps)
    splits = split(recordings, config.data, config.seed, guard_s)
    described = splits.describe()
    initial = None if init_from is None else load_checkpoint(init_from)
    checkpoint: Checkpoint | None = None
    if resume:
        folder.check_same(config, described)
        checkpoint = load_checkpoint(folder.last) if folder.last.exists() else None
    state = RunState()
    module = TrainingModule(network, config, state)
    if init_from is not None and initial is not None:
        start_from(module, initial, init_from)
    if checkpoint is not None:
        restore(module, checkpoint, folder.last)
    keeper, stopper = Keeper(folder, described, checkpoint), Stopper(max_minutes)
    narrator = Narrator(talk=talk, progress=progress)
    left = config.optimisation.epochs - state.epoch
    trainer = _trainer(config, folder, [stopper, keeper, narrator], left)
    starts = trainer.is_global_zero and not resume
    if starts:
        folder.require_new()
    scenes = prepare_scenes(
        config,
        splits,
        network.config.horizon_steps,
        cache=cache,
        progress=progress and trainer.is_global_zero,
    )
    if checkpoint is None and initial is None:
        _fit_statistics(module, scenes, config.seed)
    _require_shares(trainer, config, scenes)
    if starts:
        folder.start(config, described, weights_hash(module.average) if initial else "")
    narrator.introduce(trainer, module, scenes, splits, folder)
    _fit(trainer, module, SceneLoaders(scenes, config, state))
    return module


def _fit(trainer: lightning.Trainer, module: TrainingModule, loaders: SceneLoaders) -> None:
    """Train what is left, if anything is."""
    patience = module.config.trainer.patience_epochs
    if not trainer.max_epochs or 0 < patience <= epochs_without_better(module):
        module.trainer = trainer
        return
    with quiet():
        try:
            trainer.fit(module, datamodule=loaders)
        except SystemExit as error:  # what Lightning makes of Ctrl-C before and after the Stopper
            raise KeyboardInterrupt from error


def _trainer(
    config: TrainingConfig,
    folder: RunFolder,
    callbacks: list[lightning.Callback],
    epochs: int,
) -> lightning.Trainer:
    """Lightning's trainer, less what this package does itself."""
    options = config.trainer
    several = options.devices != 1 or options.num_nodes > 1
    strategy = options.strategy
    if several or strategy == "ddp":
        # No covariance is computed in the first epochs, so its weights get no gradient there.
        strategy = "ddp_find_unused_parameters_true"
    try:
        with quiet():
            return lightning.Trainer(
                accelerator=options.accelerator,
                devices=options.devices or "auto",
                num_nodes=options.num_nodes,
                strategy=strategy,
                precision=options.precision,  # type: ignore[arg-type]
                max_epochs=epochs,
                logger=TensorBoardLogger(folder.path, name="", version="tensorboard"),
                callbacks=callbacks,
                use_distributed_sampler=False,  # SceneLoaders gives each process its share
                reload_dataloaders_every_n_epochs=1,  # every epoch draws its own scenes
                num_sanity_val_steps=0,
                enable_checkpointing=False,
                enable_progress_bar=False,
                enable_model_summary=False,
            )
    except (MisconfigurationException, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"the section trainer (accelerator {options.accelerator!r}, {options.devices} "
            f"device(s), precision {options.precision!r}) does not fit this machine: {reason}"
        ) from error


def _require_shares(trainer: lightning.Trainer, config: TrainingConfig, scenes: Scenes) -> None:
    """That every process finds a scene in every batch.

    Raises:
        ConfigurationError: one would not.
    """
    processes, size = trainer.world_size, config.optimisation.batch_scenes
    if processes > 1 and min(size // 2, len(scenes.training)) < processes:
        raise ConfigurationError(
            f"optimisation.batch_scenes is {size}, with {len(scenes.training)} scenes an epoch, "
            f"expected at least {2 * processes} of both for {processes} processes"
        )


def _threads(config: TrainingConfig) -> int:
    """Threads of torch: one for each of several processes on a CPU, which share its cores."""
    options = config.trainer
    on_cpu = options.accelerator == "cpu" or (
        options.accelerator == "auto" and not torch.cuda.is_available()
    )
    return 1 if on_cpu and options.devices != 1 else config.num_threads


def _fit_statistics(module: TrainingModule, scenes: Scenes, seed: int) -> None:
    """Fill the network's scales from a random part of the first epoch."""
    order = torch.Generator().manual_seed(seed)
    loader = DataLoader(scenes.training, STATISTICS_SCENES, shuffle=True, generator=order)
    fields = dense(next(iter(loader)))
    module.model.fit_statistics(fields["x"], fields["valid"])
    module.average.load_state_dict(module.model.state_dict())


@contextmanager
def quiet() -> Iterator[None]:
    """Keep Lightning's tips and notes to itself; this package says what there is to say."""
    for name in ("lightning.pytorch", "lightning.fabric"):
        logging.getLogger(name).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"lightning\.")
        warnings.filterwarnings("ignore", message=r".*num_workers.*")
        yield
