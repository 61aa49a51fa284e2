# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model for speed measurements: the default architecture, exported without training."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from mtpgo_core.task.model_file import find_model, load_task

REFERENCE = "reference"
"""Its name on the command line."""


@contextmanager
def model_file(name: str) -> Iterator[Path]:
    """Yield the file of a model by name or path; ``reference`` is exported to a temporary folder.

    Raises:
        ModelFileError: the file is no model.
    """
    if name != REFERENCE:
        path = find_model(name)
        load_task(path)
        yield path.resolve()
        return
    from mtpgo_core.task.task_description import TaskDescription
    from mtpgo_training.benchmark.latency_benchmark import make_model
    from mtpgo_training.export.exporter import export_model

    with TemporaryDirectory() as folder:
        path = Path(folder, f"{REFERENCE}.pt")
        export_model(make_model(), TaskDescription(name=REFERENCE), path)
        yield path
