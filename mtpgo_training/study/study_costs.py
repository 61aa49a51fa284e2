# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the rows of a study cost: parameters, and the time of a training."""

from __future__ import annotations

import time

import torch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.study.study_rows import Study, row_config
from mtpgo_training.table_format import Row, Table
from mtpgo_training.training.networks import build_network, parameter_count
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.arc_traffic import arc_batch
from mtpgo_training.training.trial.epoch_cost import take_step, training_device

PAPER_SCENES = {"highd": 80_323, "round": 23_398, "ind": 6_256}
"""Scenes of an epoch: 80 % of the samples of the paper's data sets (section VI-A: 100404, 29248
and 7820)."""

MEASURED_SCENES = 48
"""Scenes of the measured step; chosen: several micro-batches, seconds for the largest row."""


def costs_table(study: Study, *, measure: bool = False) -> Table:
    """Return for each row its name, its parameters, and how it departs from its recipe.

    Args:
        study: which one.
        measure: also take the time of a training step of each row on this machine, and say how
            long a training of the paper's data sets takes at this speed (h). One thread on a CPU.
    """
    columns = ["row", "title", "parameters", "departs from the recipe by"]
    if measure:
        columns += ["scenes/s", *(f"{name} h" for name in study.data_sets)]
    rows = []
    total_h = dict.fromkeys(study.data_sets, 0.0)
    for row in study.rows:
        if not row.is_trained:
            rows.append(_row(columns, row.name, row.title, "-", "nothing to train"))
            continue
        try:
            config = row_config(row, study.data_sets[-1], None, ())
        except ConfigurationError as error:
            rows.append(_row(columns, row.name, row.title, "-", f"cannot be trained: {error}"))
            continue
        model = build_network(config.network, config.model, config.history, config.scene)
        cells = [row.title, str(parameter_count(model)), " ".join(row.settings) or "-"]
        if measure:
            rate = scenes_per_second(model, config)
            hours = config.optimisation.epochs / rate / 3600.0
            cells.append(f"{rate:.0f}")
            for name in study.data_sets:
                total_h[name] += hours * PAPER_SCENES[name]
                cells.append(f"{hours * PAPER_SCENES[name]:.1f}")
        rows.append(_row(columns, row.name, *cells))
    if measure:
        cells = ["one training of each", "-", "-", "-", *(f"{h:.1f}" for h in total_h.values())]
        rows.append(_row(columns, "all", *cells))
    return Table(columns, rows)


def scenes_per_second(model: TrajectoryPredictor, config: TrainingConfig) -> float:
    """Return how many scenes of made-up traffic are trained on in a second.

    The step is one of the last epochs, on the likelihood or the network's own objective, and is
    the second one: in the first one memory is allocated.

    Args:
        model: the network; its weights are changed.
        config: of its training.
    """
    device = training_device(config)
    run = TrainingRun(model.to(device), config)
    run.state.epoch = config.optimisation.main_epochs - 1
    module = BatchLoss(run).train()
    optimiser = torch.optim.AdamW(model.parameters(), lr=config.optimisation.learning_rate)
    batch = arc_batch(MEASURED_SCENES, model.config).to(device)
    start = 0.0
    for _ in range(2):
        start = time.monotonic()
        take_step(module, optimiser, batch).item()  # waits for the device
    return MEASURED_SCENES / (time.monotonic() - start)


def _row(columns: list[str], name: str, *cells: str) -> Row:
    """Return a row; columns without a cell get a dash."""
    return Row(name, [*cells, *["-"] * (len(columns) - 1 - len(cells))])
