# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the rows of a study cost: parameters, and the time of a training."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch_geometric.data import Batch

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

COUNTED_SCENES = 2
"""Scenes of the step whose operations are counted; chosen: one micro-batch, as on a GPU. The count
does not depend on how many scenes there are."""

GPU_OPERATION_S = 10e-6
"""Time in which a process starts one operation on a GPU (s); an assumption. On a core an operation
of a single scene takes 5 to 7 µs for most rows, the computation included."""

GPU_CORES = 100.0
"""Cores that a GPU is worth for the computation itself; an assumption."""


def costs_table(study: Study, *, measure: bool = False) -> Table:
    """Return for each row its name, its parameters, and how it departs from its recipe.

    Args:
        study: which one.
        measure: also take the time of a training step of each row on this machine, and say how
            long a training of the paper's data sets takes at this speed (h). One thread on a CPU,
            beside which stands an estimate for a GPU.
    """
    columns = ["row", "title", "parameters", "departs from the recipe by"]
    estimate = measure and training_device(TrainingConfig()).type == "cpu"
    if measure:
        columns += ["scenes/s", *(f"{name} h" for name in study.data_sets)]
    if estimate:
        columns += [f"{name} h, one GPU (estimate)" for name in study.data_sets]
    rows = []
    total_h = [0.0] * (len(columns) - 5)
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
            rates = [rate, gpu_scenes_per_second(model, config, rate)] if estimate else [rate]
            scenes = [config.optimisation.epochs * PAPER_SCENES[name] for name in study.data_sets]
            hours = [count / each / 3600.0 for each in rates for count in scenes]
            total_h = [total + h for total, h in zip(total_h, hours, strict=True)]
            cells += [f"{rate:.0f}", *(f"{h:.1f}" for h in hours)]
        rows.append(_row(columns, row.name, *cells))
    if measure:
        cells = ["one training of each", "-", "-", "-", *(f"{h:.1f}" for h in total_h)]
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
    step = _step(model, config)
    batch = arc_batch(MEASURED_SCENES, model.config).to(training_device(config))
    start = 0.0
    for _ in range(2):
        start = time.monotonic()
        step(batch).item()  # waits for the device
    return MEASURED_SCENES / (time.monotonic() - start)


def gpu_scenes_per_second(
    model: TrajectoryPredictor, config: TrainingConfig, core_rate: float
) -> float:
    """Return an estimate of how many scenes a GPU trains on in a second, made without one.

    A step of these networks is many small operations one after the other, so on a GPU it takes the
    time to start them, and the computation, which is faster than on a core.

    Args:
        model: the network; its weights are changed.
        config: of its training.
        core_rate: scenes a second on one core.
    """
    scenes = config.optimisation.batch_scenes
    start_s = operations_per_step(model, config) * GPU_OPERATION_S
    return scenes / (start_s + scenes / core_rate / GPU_CORES)


def operations_per_step(model: TrajectoryPredictor, config: TrainingConfig) -> int:
    """Return how many operations PyTorch carries out in a training step, of any number of scenes.

    Args:
        model: the network; its weights are changed.
        config: of its training.
    """
    step = _step(model, config)
    batch = arc_batch(COUNTED_SCENES, model.config).to(training_device(config))
    step(batch)  # The optimiser makes its state.
    with OperationCount() as counted:
        step(batch)
    return counted.operations


class OperationCount(TorchDispatchMode):
    """Counts the operations that PyTorch carries out in a ``with`` block, backward ones included.

    Attributes:
        operations: so many so far.
    """

    def __init__(self) -> None:
        super().__init__()
        self.operations = 0

    def __torch_dispatch__(
        self, func: Any, types: Any, args: Any = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        """Count one operation and carry it out."""
        self.operations += 1
        return func(*args, **(kwargs or {}))


def _step(model: TrajectoryPredictor, config: TrainingConfig) -> Callable[[Batch], Tensor]:
    """Return what takes a step of one of the last epochs on a batch and returns its loss."""
    run = TrainingRun(model.to(training_device(config)), config)
    run.state.epoch = config.optimisation.main_epochs - 1
    module = BatchLoss(run).train()
    optimiser = torch.optim.AdamW(model.parameters(), lr=config.optimisation.learning_rate)
    return lambda batch: take_step(module, optimiser, batch)


def _row(columns: list[str], name: str, *cells: str) -> Row:
    """Return a row; columns without a cell get a dash."""
    return Row(name, [*cells, *["-"] * (len(columns) - 1 - len(cells))])
