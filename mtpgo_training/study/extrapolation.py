# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions beyond the horizon of the training, as the paper shows them for 7 s."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.calibration import Calibration
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.evaluator import Settings, evaluate_all
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.export.exporter import describe, export_model, load_model
from mtpgo_training.training.run_folder import Checkpoint, load_checkpoint

Json = dict[str, Any]

_NAME = "model"


def with_horizon(checkpoint: Checkpoint, horizon_s: float) -> Checkpoint:
    """Return a checkpoint whose network rolls on to a longer horizon with the same weights.

    Args:
        checkpoint: of ``mtpgo train``.
        horizon_s: the horizon (s).

    Raises:
        ConfigurationError: it is not longer than that of the training.
    """
    config = checkpoint["model_config"]
    steps, dt_s = round(horizon_s / config["dt_s"]), config["dt_s"]
    if steps <= config["horizon_steps"]:
        raise ConfigurationError(
            f"--extrapolate is {horizon_s:g} s, expected more than the horizon of the training, "
            f"{config['horizon_steps'] * dt_s:g} s"
        )
    return {**checkpoint, "model_config": {**config, "horizon_steps": steps}}


def extrapolated_errors(
    run: Path,
    output: Path,
    test: Sequence[NamedRecording],
    horizon_s: float,
    settings: Settings,
) -> Json:
    """Export a run with a longer horizon, and return its error at each time ahead.

    ``trained_s``: the horizon of the training (s); ``time_s``; ``model``, ``cv`` and ``ca``: the
    mean distance from the truth at these times (m), None where nothing was observed.

    Args:
        run: the run folder.
        output: model file to write.
        test: recordings.
        horizon_s: the longer horizon (s).
        settings: what is scored.

    Raises:
        MtpgoError: the network's weights depend on the horizon, or it cannot be exported.
    """
    checkpoint = load_checkpoint(run)
    trained = checkpoint["model_config"]
    longer = with_horizon(checkpoint, horizon_s)
    task = dataclasses.replace(describe(longer, _NAME), calibration=Calibration())
    export_model(load_model(longer), dataclasses.replace(task, metrics={}), output)
    runner = ModelRunner.load(output, trusted=True)
    named = [(item.name, item.recording) for item in test]
    result = evaluate_all({_NAME: runner}, named, settings)
    by_horizon = breakdowns(result.scores)["by_horizon"] if len(result.scores) else {}
    if _NAME not in by_horizon:
        raise ConfigurationError("no road user of the test is observed long enough")
    errors = {
        name: by_horizon[name]["all"]["displacement"]
        for name in (_NAME, "cv", "ca")
        if name in by_horizon
    }
    return {
        "trained_s": trained["horizon_steps"] * trained["dt_s"],
        "time_s": by_horizon[_NAME]["all"]["time_s"],
        **errors,
    }
