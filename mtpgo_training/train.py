# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo train``: recordings and a configuration in, a run folder with checkpoints out."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch_geometric.loader import DataLoader
from tqdm import tqdm

from models.mtp_go import MTPGO
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.config import TrainingConfig, load_config
from mtpgo_training.dataset import SceneDataset, dense, validation_scenes
from mtpgo_training.learner import model_config
from mtpgo_training.process import prepare_process
from mtpgo_training.readers import LAYOUTS
from mtpgo_training.run_folder import RunFolder, load_checkpoint
from mtpgo_training.sources import Source, prepare
from mtpgo_training.splits import NamedRecording, Splits, read_all, split
from mtpgo_training.trainer import Trainer

STATISTICS_SCENES = 512
"""Scenes from which the model's input scales are taken."""


def train(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    folder: RunFolder,
    *,
    resume: bool = False,
    max_minutes: float | None = None,
    progress: bool = True,
) -> Trainer:
    """Train a model.

    Args:
        config: the configuration.
        recordings: all recordings; the configuration says which teach.
        folder: the run's folder, new unless ``resume``.
        resume: go on with the run in the folder; its configuration and data must be the same.
        max_minutes: stop cleanly after this long.
        progress: show progress bars.

    Raises:
        ConfigurationError: the configuration, the split or the folder cannot be used.
    """
    splits = split(recordings, config.data, config.seed)
    options = model_config(config.model, config.history, config.scene)
    if resume:
        folder.check_same(config, splits.describe())
    else:
        folder.start(config, splits.describe())
    torch.manual_seed(config.seed)
    dataset, validation = _datasets(config, splits, options.horizon_steps, progress)
    model = MTPGO(options)
    _fit_statistics(model, dataset, config.seed)
    trainer = Trainer(model, config, dataset, validation, folder, splits.describe())
    if resume and folder.last.exists():
        trainer.restore(load_checkpoint(folder.last))
    trainer.fit(max_minutes=max_minutes, progress=progress)
    return trainer


def _fit_statistics(model: MTPGO, dataset: SceneDataset, seed: int) -> None:
    """Fill the model's scales from a random part of the first epoch."""
    order = torch.Generator().manual_seed(seed)
    loader = DataLoader(dataset, STATISTICS_SCENES, shuffle=True, generator=order)
    fields = dense(next(iter(loader)))
    model.fit_statistics(fields["x"], fields["valid"])


def _datasets(
    config: TrainingConfig, splits: Splits, horizon_steps: int, progress: bool
) -> tuple[SceneDataset, list[Any]]:
    def sources(named: Sequence[NamedRecording], training: bool) -> list[Source]:
        bar = tqdm(
            named,
            desc="training recordings" if training else "validation recordings",
            disable=not progress,
            leave=False,
        )
        return [
            prepare(
                item.recording,
                config.history,
                config.scene,
                config.data,
                training=training,
                seed=config.seed,
                weight=config.data.source_weight.get(item.source, 1.0),
            )
            for item in bar
        ]

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
    return dataset, validation


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo train`` to the command line."""
    parser = subparsers.add_parser("train", help="train a model on recordings")
    parser.add_argument("config", type=Path, help="YAML configuration of the training")
    parser.add_argument(
        "--data", type=Path, action="append", required=True, help="directory with recordings"
    )
    parser.add_argument(
        "--layout",
        action="append",
        required=True,
        help=f"layout of each --data, or one for all: {', '.join(LAYOUTS)}",
    )
    parser.add_argument("--out", type=Path, required=True, help="run folder")
    parser.add_argument("--resume", action="store_true", help="go on with an interrupted run")
    parser.add_argument("--epochs", type=int, help="overrides optimisation.epochs")
    parser.add_argument("--seed", type=int, help="overrides seed")
    parser.add_argument(
        "--minutes", "--max-minutes", type=float, help="stop cleanly after this long (min)"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bars")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo train``."""
    config = load_config(args.config)
    if args.epochs is not None:
        optimisation = dataclasses.replace(config.optimisation, epochs=args.epochs)
        config = dataclasses.replace(config, optimisation=optimisation)
    if args.seed is not None:
        config = dataclasses.replace(config, seed=args.seed)
    prepare_process(config.num_threads)
    trainer = train(
        config,
        read_all(pair_layouts(args.data, args.layout)),
        RunFolder(args.out),
        resume=args.resume,
        max_minutes=args.minutes,
        progress=not args.quiet and sys.stderr.isatty(),
    )
    if trainer.table is not None:
        print(f"validation after epoch {trainer.epoch}, all agents:")
        print(trainer.table.text("all"))
    print(f"checkpoints: {args.out}")
    return 0


def pair_layouts(directories: Sequence[Path], layouts: Sequence[str]) -> list[tuple[Path, str]]:
    """Each directory with its layout; a single layout serves all.

    Raises:
        ConfigurationError: other numbers of the two.
    """
    if len(layouts) == 1:
        layouts = list(layouts) * len(directories)
    if len(layouts) != len(directories):
        raise ConfigurationError(
            f"--layout is given {len(layouts)} times for {len(directories)} times --data, "
            "expected once or as often"
        )
    return list(zip(directories, layouts, strict=True))
