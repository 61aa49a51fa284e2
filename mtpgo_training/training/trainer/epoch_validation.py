# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Validation at an epoch's end: by all processes together, with one verdict."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch_geometric.loader import DataLoader

from mtpgo_training.evaluation.scorebook import ScoreBook, ScoreTable
from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.batch_loss import Fields
from mtpgo_training.training.objective import objective
from mtpgo_training.training.trainer.training_module import TrainingModule
from mtpgo_training.training.validation import Reach, validate

BATCH_SCENES = 64


def judge(module: TrainingModule) -> tuple[ScoreTable, bool]:
    """Score the averaged weights; remember them as the best if they are (or the last is kept).

    Args:
        module: the module at the end of an epoch whose row is not in the log yet.

    Returns:
        The scores, and whether they are the best so far.
    """
    state = module.state
    module.average.eval()
    book, reach = _together(module, 1.0)
    table = book.table()
    merit = _merit(module, table)
    better = merit < state.best or module.config.optimisation.keep == "last"
    if better:
        state.best, state.best_epoch = merit, state.epoch + 1
        state.scale = reach.scale()
        calibrated, _ = _together(module, state.scale)
        state.metrics = calibrated.table().to_dict()
    return table, better


def _merit(module: TrainingModule, table: ScoreTable) -> float:
    """What the best checkpoint has least of: ADE, once the likelihood alone is trained.

    Before, no covariance has been learned, so such a checkpoint is better than none only.
    """
    ade = table.models["model"]["all"]["ade"]
    return ade + (0.0 if module.aim.ewta_weight == 0.0 else 1e3)


def epochs_without_better(module: TrainingModule) -> int:
    """Epochs on the likelihood alone since the best one, the module's last epoch included."""
    options, state = module.config.optimisation, module.state
    modes = module.model.config.modes
    return sum(
        objective(epoch, options.epochs, modes).ewta_weight == 0.0
        for epoch in range(state.best_epoch, state.epoch)
    )


def _together(module: TrainingModule, scale: float) -> tuple[ScoreBook, Reach]:
    """Every process scores its share of the scenes; all get the whole."""
    trainer = module.trainer
    book, reach = validate(module.average, _batches(module), scale)
    if trainer.world_size > 1:
        shares: list[tuple[ScoreBook, Reach] | None] = [None] * trainer.world_size
        torch.distributed.all_gather_object(shares, (book, reach))
        book, reach = ScoreBook(), Reach()
        for share in shares:
            assert share is not None
            book.merge(share[0])
            reach.merge(share[1])
    return book, reach


def _batches(module: TrainingModule) -> Iterator[Fields]:
    trainer = module.trainer
    scenes = module.loaders.scenes.validation[trainer.global_rank :: trainer.world_size]
    return (dense(batch) for batch in DataLoader(scenes, batch_size=BATCH_SCENES))
