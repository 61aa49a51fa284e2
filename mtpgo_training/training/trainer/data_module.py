# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a run is fed: scenes of the recordings, and an epoch's batches in an order of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import lightning
import torch
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.scenes.prepared_recording import PreparedRecording, prepare_all
from mtpgo_training.scenes.scene_dataset import SceneDataset, validation_scenes
from mtpgo_training.training.microbatch import share_of
from mtpgo_training.training.trainer.run_state import RunState
from mtpgo_training.training.training_config import TrainingConfig


@dataclass(frozen=True)
class Scenes:
    """The scenes of a run.

    Attributes:
        training: drawn anew for every epoch.
        validation: the same throughout.
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
    """Make all recordings ready.

    Args:
        config: the configuration.
        splits: the recordings by use.
        horizon_steps: H.
        cache: where what is costly to compute is kept.
        progress: show a bar.

    Raises:
        ConfigurationError: nobody is present in the recordings of a use.
    """

    def sources(named: Sequence[NamedRecording], training: bool) -> list[PreparedRecording]:
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
        sources(splits.train, True),
        config.history,
        config.scene,
        config.data,
        horizon_steps,
        config.seed,
    )
    validation = validation_scenes(
        sources(splits.validation, False), config.history, config.scene, horizon_steps
    )
    if not len(dataset):
        raise ConfigurationError("no agent is present in any recording of data.train")
    if not validation:
        raise ConfigurationError("no agent is present in any recording of data.validation")
    return Scenes(dataset, validation)


class SceneLoaders(lightning.LightningDataModule):
    """The batches of an epoch: they follow from the seed and the epoch's number alone.

    Each of several processes takes its share of every batch, so that a step learns from the same
    scenes on any number of devices. What is left at an epoch's end joins the last whole batch if
    it is less than half of one: a step from a scene or two is mostly noise.
    """

    def __init__(self, scenes: Scenes, config: TrainingConfig, state: RunState) -> None:
        """Keep what the batches are made of.

        Args:
            scenes: the run's scenes.
            config: the configuration.
            state: how far the run is; the loader of an epoch under way begins where it stands.
        """
        super().__init__()
        self.scenes = scenes
        self.config = config
        self.state = state
        self.steps = 0
        """Batches of the epoch under way, those included that are done."""

    def train_dataloader(self) -> DataLoader:
        """What is left of the epoch under way."""
        dataset, size = self.scenes.training, self.config.optimisation.batch_scenes
        dataset.set_epoch(self.state.epoch)
        seed = self.config.seed * 1_000_003 + self.state.epoch
        order = torch.randperm(len(dataset), generator=torch.Generator().manual_seed(seed))
        rank, processes = (
            (self.trainer.global_rank, self.trainer.world_size) if self.trainer else (0, 1)
        )
        cuts = tuple(range(size, len(order) - (size + 1) // 2 + 1, size))
        batches = order.tensor_split(cuts)
        self.steps = len(batches)
        mine = []
        for batch in batches[self.state.batch :]:
            sizes = [dataset.items[i].agents for i in batch.tolist()]
            mine.append(batch[share_of(sizes, rank, processes)].tolist())
        return DataLoader(
            dataset,
            batch_sampler=mine,
            num_workers=self.config.trainer.loader_workers,
        )
