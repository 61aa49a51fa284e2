# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checkpoints of a run: save one, resume from one, start from the weights in one."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from torch.optim import Optimizer

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_training.data.readers.recording_parts import span_of
from mtpgo_training.data.splits import Splits
from mtpgo_training.evaluation.training_overlap import uses_of
from mtpgo_training.training.networks import MTP_GO
from mtpgo_training.training.run_folder import Checkpoint, RunFolder
from mtpgo_training.training.run_state import Row, RunState, TrainingRun
from mtpgo_training.training.training_config import TrainingConfig

if TYPE_CHECKING:  # Fabric takes seconds to load
    from lightning_fabric.plugins import Precision


def save_checkpoint(
    run: TrainingRun,
    folder: RunFolder,
    splits: list[dict[str, str]],
    *,
    optimiser: dict[str, Any],
    precision: dict[str, Any],
    best: bool,
) -> None:
    """Write ``last.pt``, the log, and ``best.pt`` with the validation's samples if it is the best.

    Args:
        run: the run.
        folder: its folder.
        splits: names and hashes of the recordings.
        optimiser: its state.
        precision: state of the gradient scaler, if there is one.
        best: whether the last validation is the best so far.
    """
    state = run.state
    exported = _exported(run, splits)
    resumed = {
        "model": run.model.state_dict(),
        "optimiser": optimiser,
        "precision": precision,
        "state": dataclasses.asdict(state),
    }
    if best and run.samples is not None:
        run.samples.save(folder.samples)
    folder.save(exported, resumed, best=best)
    if state.rows:
        folder.write_log(state.rows)


def save_unfinished(
    run: TrainingRun, folder: RunFolder, splits: list[dict[str, str]], row: Row, *, best: bool
) -> None:
    """Write the log with an epoch that is not completed, and ``best.pt`` if it is the best.

    ``last.pt`` stays as it is, and the best one so far is kept: a resumed run completes the epoch
    as if it had not been validated.

    Args:
        run: the run.
        folder: its folder.
        splits: names and hashes of the recordings.
        row: of the log.
        best: whether the last validation is the best so far.
    """
    if best:
        folder.keep_best()
        if run.samples is not None:
            run.samples.save(folder.samples)
        folder.save_best(_exported(run, splits))
    folder.write_log([*run.state.rows, row])


def _exported(run: TrainingRun, splits: list[dict[str, str]]) -> Checkpoint:
    """Return everything that an export needs."""
    state = run.state
    return {
        "config": dataclasses.asdict(run.config),
        "network": run.config.network,
        "model_config": run.model.config.to_dict(),
        "average": run.average.state_dict(),
        "epoch": state.epoch,
        "step": state.step,
        "calibration": state.calibration,
        "metrics": state.metrics,
        "splits": splits,
    }


def resume_from(run: TrainingRun, checkpoint: Checkpoint, path: Path) -> None:
    """Restore the weights and the state from ``last.pt``.

    Args:
        run: a new run of the same configuration.
        checkpoint: content of ``path``.
        path: for the error.

    Raises:
        ConfigurationError: the checkpoint is not a ``last.pt``, or of another architecture.
    """
    try:
        run.model.load_state_dict(checkpoint["model"])
        run.average.load_state_dict(checkpoint["average"])
        run.state = from_dict(RunState, checkpoint["state"], "state")
    except (KeyError, TypeError, RuntimeError, ConfigurationError) as error:
        raise ConfigurationError(
            f"{path} does not fit the configured network or this version's trainer: "
            f"{_short(error)}"
        ) from error


def restore_optimiser(
    optimiser: Optimizer, precision: Precision, checkpoint: Checkpoint, path: Path
) -> None:
    """Restore the optimiser and what belongs to the precision from ``last.pt``.

    Args:
        optimiser: a new one of the same parameters.
        precision: of the run, with its gradient scaler if there is one.
        checkpoint: content of ``path``.
        path: for the error.

    Raises:
        ConfigurationError: the checkpoint has no such state, or that of other parameters.
    """
    try:
        optimiser.load_state_dict(checkpoint["optimiser"])
        precision.load_state_dict(checkpoint["precision"])
        for parameter, state in optimiser.state.items():
            for name in ("exp_avg", "exp_avg_sq"):
                if state[name].shape != parameter.shape:
                    raise ValueError(f"{name} is of another parameter")
            float(state["step"])
    except (KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise ConfigurationError(
            f"{path} does not fit the optimiser of the run: {_short(error)}"
        ) from error


def start_from(run: TrainingRun, checkpoint: Checkpoint, path: Path) -> None:
    """Start with the averaged weights of another run.

    Args:
        run: a new run.
        checkpoint: content of ``path``.
        path: for the error.

    Raises:
        ConfigurationError: they belong to another architecture or to other inputs.
    """
    network = checkpoint.get("network", MTP_GO)
    if network != run.config.network:
        raise ConfigurationError(
            f"the weights of {path} are of {network!r}, but the configured network is "
            f"{run.config.network!r}, expected the same"
        )
    try:
        stored = from_dict(TrainingConfig, checkpoint["config"], f"the configuration in {path}")
        if _inputs(stored) != _inputs(run.config):
            raise ConfigurationError(
                f"the weights of {path} were trained on other inputs ({_inputs(stored)}), "
                f"expected those of the configuration ({_inputs(run.config)})"
            )
        run.model.load_state_dict(checkpoint["average"])
        run.average.load_state_dict(checkpoint["average"])
    except (KeyError, RuntimeError) as error:
        raise ConfigurationError(
            f"the weights of {path} do not fit the configured network: {_short(error)}"
        ) from error


def all_recordings(
    splits: list[dict[str, str]], initial: Checkpoint | None
) -> list[dict[str, str]]:
    """Return the recordings of a run and those of the weights that it starts from, each use once.

    Parts of one recording have its hash: those from other times are other entries.

    Args:
        splits: names, hashes and uses of the recordings of the run.
        initial: checkpoint of the weights, None for random ones.
    """
    earlier = [] if initial is None else initial.get("splits", [])
    seen = {_use(entry) for entry in splits}
    return splits + [entry for entry in earlier if _use(entry) not in seen]


def seen_in_validation(splits: Splits, initial: Checkpoint) -> list[str]:
    """Return the names of validation recordings that the first weights were trained on.

    Args:
        splits: the recordings of the run by use.
        initial: checkpoint of the weights.
    """
    training = {"recordings": initial["splits"]}
    return [
        item.name
        for item in splits.validation
        if "train" in uses_of(training, item.recording.sha256, item.name)
    ]


def _use(entry: dict[str, str]) -> tuple[str, str, float, float]:
    """Return content, use, begin and end (s) of a recording, or part of one, in a list of them."""
    return entry["sha256"], entry["split"], *span_of(entry["name"])


def _inputs(config: TrainingConfig) -> str:
    """Describe the meaning of the numbers in a network's input."""
    scene, history = config.scene, config.history
    return (
        f"frame {scene.frame}, context {scene.context}, classes {', '.join(scene.classes)}, "
        f"{history.steps} steps of {history.dt_s:g} s"
    )


def _short(error: Exception) -> str:
    """Return the error's text on one line."""
    return " ".join(str(error).split())[:200]
