# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scenes of a run and the batches of an epoch."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.context import BaseContext

import torch
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.scenes.prepared_recording import (
    PreparedRecording,
    prepare_all,
    source_weight,
)
from mtpgo_training.scenes.scene_dataset import SceneDataset, validation_scenes
from mtpgo_training.training.losses.gradient_accumulation import process_share
from mtpgo_training.training.run_loss import consistency_term
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import TrainingConfig


@dataclass(frozen=True)
class Scenes:
    """The scenes of a run.

    Attributes:
        training: sampled again for every epoch.
        validation: the same in every epoch.
    """

    training: SceneDataset
    validation: list[Data]


def prepare_scenes(
    config: TrainingConfig,
    splits: Splits,
    horizon_steps: int,
    *,
    cache: RecordingCache | None = None,
    progress: bool,
) -> Scenes:
    """Prepare all recordings and cut the validation scenes.

    Args:
        config: the configuration.
        splits: the recordings by use.
        horizon_steps: H.
        cache: keeps what is expensive to compute.
        progress: show a bar.

    Raises:
        ConfigurationError: the recordings of a split hold no agent, or none with a future.
    """

    def prepared(named: Sequence[NamedRecording], *, training: bool) -> list[PreparedRecording]:
        return prepare_all(
            named,
            config.history,
            config.scene,
            config.data,
            training=training,
            horizon_steps=horizon_steps,
            seed=config.seed,
            cache=cache,
            progress=progress,
        )

    dataset = SceneDataset(
        prepared(splits.train, training=True),
        config.history,
        config.scene,
        config.data,
        horizon_steps,
        config.seed,
        pairs=consistency_term(config, horizon_steps).weight > 0.0,
    )
    validation = validation_scenes(
        prepared(splits.validation, training=False), config.history, config.scene, horizon_steps
    )
    if not len(dataset):
        raise ConfigurationError("no agent is present in any recording of data.train")
    if not validation:
        raise ConfigurationError("no agent is present in any recording of data.validation")
    if not any((scene.weight > 0.0)[scene.primary].any() for scene in validation):
        raise ConfigurationError(
            "no agent of data.validation is observed at any step after it was predicted "
            f"(history.dt_s is {config.history.dt_s:g} s), expected longer recordings"
        )
    return Scenes(dataset, validation)


def reweighted(scenes: Scenes, splits: Splits, config: TrainingConfig) -> Scenes:
    """Return the scenes as they are with other values of ``data.source_weight``.

    Args:
        scenes: prepared with the configuration as it was before.
        splits: the recordings by use.
        config: the configuration.
    """
    old = scenes.training
    sources = [
        dataclasses.replace(source, weight=source_weight(item, config.data))
        for source, item in zip(old.sources, splits.train, strict=True)
    ]
    dataset = SceneDataset(
        sources,
        old.history,
        old.scene,
        config.data,
        old.horizon_steps,
        old.seed,
        pairs=old.pairs,
    )
    if not len(dataset):
        raise ConfigurationError(
            "the time is too short for a single scene in an epoch, expected more with --minutes"
        )
    return dataclasses.replace(scenes, training=dataset)


def epoch_loader(
    dataset: SceneDataset, run: TrainingRun, rank: int, processes: int
) -> tuple[DataLoader, int]:
    """Return the remaining batches of the current epoch, and the number of all its batches.

    They follow from the seed and the epoch alone. Each of several processes takes its share of
    every batch, so that a step sees the same scenes on any number of devices. Scenes left over at
    the end of an epoch join the last whole batch if they are fewer than half of one: the gradient
    of a scene or two is mostly noise. Scenes are pairs only where the epoch's loss compares them.

    Args:
        dataset: the training scenes, which are sampled for the epoch.
        run: the run, whose progress gives the epoch and its completed batches.
        rank: number of this process.
        processes: number of processes.
    """
    config, state = run.config, run.state
    dataset.set_epoch(state.epoch)
    size, workers = config.optimisation.batch_scenes, config.trainer.loader_workers
    seed = config.seed * 1_000_003 + state.epoch  # a prime above any number of epochs
    order = torch.randperm(len(dataset), generator=torch.Generator().manual_seed(seed))
    batches = order.tensor_split(tuple(range(size, len(order) - (size + 1) // 2 + 1, size)))
    shares = []
    for batch in batches[state.batch :]:
        sizes = [dataset.items[i].agents for i in batch.tolist()]
        shares.append(batch[process_share(sizes, rank, processes)].tolist())
    loader = DataLoader(
        dataset if run.compares_windows else dataset.without_pairs(),
        batch_sampler=shares,
        num_workers=workers,
        multiprocessing_context=_worker_context() if workers else None,
        worker_init_fn=_follow_main_process if workers else None,
    )
    return loader, len(batches)


def _worker_context() -> BaseContext:
    """Return how workers are started: by a fork of this process they may deadlock on its threads.

    They are forks of a server without threads that has imported torch once.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return context


def _follow_main_process(worker: int) -> None:
    """Leave Ctrl-C to the main process, which completes its step first, and end when it has ended.

    torch's workers end with the process that has forked them. That is the server here, which in
    turn runs for as long as they do: after a killed training they would stay forever.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_main_process, daemon=True).start()


def _end_with_main_process() -> None:
    main = multiprocessing.parent_process()
    assert main is not None
    main.join()
    os._exit(1)
