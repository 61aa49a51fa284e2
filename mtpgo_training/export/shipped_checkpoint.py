# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The checkpoint of a model file: what a further training or an adaptation starts from."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.training.run_folder import Checkpoint, write_checkpoint

KEYS = ("config", "network", "model_config", "epoch", "step", "splits", "adapted_from")
"""What the file takes over from a checkpoint, as far as it is there."""


def write_shipped_checkpoint(checkpoint: Checkpoint, task: TaskDescription, path: Path) -> None:
    """Write the averaged weights of a run and what describes them, as plain data.

    The weights are in float32, each without the memory that it may share with others. Name,
    calibration and metrics are those of the model file.

    Args:
        checkpoint: content of a checkpoint of ``mtpgo train``.
        task: task description of the model that was exported from it.
        path: file to write, atomically.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    weights = {
        name: (value.float() if value.is_floating_point() else value).detach().cpu().clone()
        for name, value in checkpoint["average"].items()
    }
    content = {
        **{key: checkpoint[key] for key in KEYS if key in checkpoint},
        "config": {**checkpoint["config"], "name": task.name},
        "average": weights,
        "covariance_scale": task.model.get("covariance_scale", 1.0),
        "calibration": dataclasses.asdict(task.calibration),
        "metrics": task.metrics.get("validation", {}),
    }
    write_checkpoint(path, content)
