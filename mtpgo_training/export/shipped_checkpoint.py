# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The checkpoint of a model file: what a further training or an adaptation starts from."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.model_file import CHECKPOINT_SUFFIX, is_model_file, load_task
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.export.exporter import load_model
from mtpgo_training.training.networks import weights_hash
from mtpgo_training.training.run_folder import Checkpoint, load_checkpoint, write_checkpoint

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


def require_pair(given: str | Path, checkpoint: Path) -> None:
    """Check that the checkpoint found beside a model file has its weights.

    An export without a checkpoint, or a copied file, leaves that of another model there.

    Args:
        given: what the user named: anything but a model file has no pair.
        checkpoint: what was found, see :func:`mtpgo_core.task.model_file.find_checkpoint`.

    Raises:
        ConfigurationError: it has other weights, or cannot be read.
    """
    if not is_model_file(Path(given)):
        return
    if not _has_weights_of(load_task(Path(given)), checkpoint):
        raise ConfigurationError(
            f"{checkpoint} has other weights than the model file {given} that it is beside, "
            "expected the pair that 'mtpgo export' writes with --checkpoint, or the name of the "
            "checkpoint itself to start from that"
        )


def foreign_checkpoint(model: Path, task: TaskDescription) -> str:
    """Return a warning of a checkpoint beside a new model file that is of another model.

    Args:
        model: the model file.
        task: its description.

    Returns:
        The sentence, empty if there is no such checkpoint.
    """
    beside = model.with_suffix(CHECKPOINT_SUFFIX)
    try:
        if not beside.is_file() or _has_weights_of(task, beside):
            return ""
    except ConfigurationError:  # damaged, or of an earlier version
        pass
    return (
        f"{beside} is not the checkpoint of the model {model} that was written beside it, and is "
        f"not taken for it: --checkpoint {beside} replaces it"
    )


def _has_weights_of(task: TaskDescription, checkpoint: Path) -> bool:
    """Return whether a checkpoint has the weights of a model, by their hash.

    Raises:
        ConfigurationError: the checkpoint cannot be read.
    """
    return weights_hash(load_model(load_checkpoint(checkpoint))) == task.weights_sha256
