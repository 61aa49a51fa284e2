# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Results of items in a folder, so that an interrupted run goes on where it was.

They are stored as entries of a :class:`~mtpgo_training.data.recording_cache.RecordingCache`: whole
or not at all, with check sums, under a name that depends on the item's files, the settings and the
code. What is read back may consist of arrays, plain values and named classes only, so that a file
in the folder cannot run code.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.readers.checks.reading_remarks import (
    keeping,
    packed_remarks,
    say_again,
)
from mtpgo_training.data.recording import Columns
from mtpgo_training.data.recording_cache import RecordingCache

R = TypeVar("R")

_ARRAYS = {
    ("numpy", "dtype"),
    ("numpy", "ndarray"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.numeric", "_frombuffer"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy.core.numeric", "_frombuffer"),
}
"""What numpy's arrays and scalars are made with, in numpy 1 and 2."""


def kept_or_made(
    folder: Path | None,
    facts: dict[str, Any],
    make: Callable[[], R],
    classes: Sequence[type],
    *code: Callable[..., Any],
) -> R:
    """Return a result from a folder, made and kept there if the folder lacks it.

    Args:
        folder: the folder, None keeps nothing.
        facts: what determines the result besides the code, as JSON can write it.
        make: makes the result.
        classes: the classes of this project that a result consists of.
        code: the functions that make it.
    """
    if folder is None:
        return make()

    said: list[str] = []

    def columns() -> Columns:
        with keeping(said):
            result = make()
        return {
            "result": np.frombuffer(pickle.dumps(result, protocol=5), dtype=np.uint8),
            "remarks": packed_remarks(said, ()),
        }

    stored = RecordingCache(folder).entry(facts, columns, code=code)
    with keeping(said):
        say_again(stored["remarks"], ())
    result: R = _Reader(stored["result"].tobytes(), classes).load()
    return result


class _Reader(pickle.Unpickler):
    """Reads a result that consists of arrays, plain values and some classes."""

    def __init__(self, data: bytes, classes: Sequence[type]) -> None:
        super().__init__(io.BytesIO(data))
        self._classes = {(one.__module__, one.__qualname__): one for one in classes}

    def find_class(self, module: str, name: str) -> Any:
        """Return a class or function by its name.

        Raises:
            ConfigurationError: a result does not consist of it.
        """
        if (module, name) in self._classes:
            return self._classes[module, name]
        if (module, name) in _ARRAYS:
            return super().find_class(module, name)
        raise ConfigurationError(
            f"a result that was kept for --resume holds {module}.{name}, which is none of ours; "
            "expected a folder that only this command wrote"
        )
