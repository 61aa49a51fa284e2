# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Loads the model that the parameters name. No ROS here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mtpgo_core.task.model_file import find_model, is_shipped, read_model
from mtpgo_core.task.model_trial import start_trials
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.executable import return_free_memory, stop_requested

if TYPE_CHECKING:
    from mtpgo_core.prediction.model_runner import ModelRunner


def load_model(parameters: PredictorParameters) -> ModelRunner:
    """Return the model that the parameters name, loaded and warm.

    Raises:
        ModelFileError: it cannot be used, has another hash than the parameters ask for, or the
            process is asked to stop.
    """
    path = find_model(parameters.model)
    # Before torch is imported, which takes seconds: only for a file that is usable.
    read_model(path, parameters.model_sha256)
    if not is_shipped(path):
        start_trials()  # the other process imports torch while this one does
    from mtpgo_core.prediction.model_runner import ModelRunner

    runner = ModelRunner.load(
        path, parameters.num_threads, sha256=parameters.model_sha256, stopped=stop_requested
    )
    return_free_memory()
    return runner
