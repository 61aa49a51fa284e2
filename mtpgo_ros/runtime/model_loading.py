# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Loads the model of the node, so that a signal interrupts it. No ROS here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mtpgo_core.task.model_file import find_model, is_shipped, read_model
from mtpgo_core.task.model_trial import start_trials
from mtpgo_ros.runtime.allocator import return_free_memory
from mtpgo_ros.runtime.executable import stop_requested

if TYPE_CHECKING:
    from mtpgo_core.prediction.model_runner import ModelRunner


def load_model(name_or_path: str, num_threads: int, sha256: str) -> ModelRunner:
    """Return a model, loaded and warm.

    Args:
        name_or_path: see :func:`mtpgo_core.task.model_file.find_model`.
        num_threads: threads of torch in this process.
        sha256: SHA-256 that the file must have, empty for any.

    Raises:
        ModelFileError: it cannot be used, or the process is asked to stop; a signal in the main
            thread raises :class:`mtpgo_ros.runtime.executable.Interrupted` instead.
    """
    path = find_model(name_or_path)
    # Before torch is imported, which takes seconds: only for a file that is usable.
    file = read_model(path, sha256)
    if not is_shipped(path):
        start_trials()  # the other process imports torch while this one does
    from mtpgo_core.prediction.model_runner import ModelRunner

    runner = ModelRunner.load_file(file, num_threads, stopped=stop_requested)
    return_free_memory()
    return runner
