# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of Parquet and Feather files; pyarrow, from the extra ``datasets``, reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from mtpgo_core.errors import RecordingError


def parquet_columns(path: Path) -> list[str]:
    """Return the column names of a Parquet file.

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        return [str(name) for name in parquet.read_schema(path).names]
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise RecordingError(_cannot_be_read(path, "Parquet", error)) from error


def read_parquet(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Return columns of a Parquet file, of the types that they have there.

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        # One thread: recordings are read beside trainings, and several at a time.
        table = parquet.read_table(path, columns=list(columns), use_threads=False)
        return table.to_pandas(use_threads=False, ignore_metadata=True)
    except (pyarrow.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise RecordingError(_cannot_be_read(path, "Parquet", error)) from error


def read_feather(path: Path) -> pd.DataFrame:
    """Return a Feather file (Arrow's own format).

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import feather

    try:
        return feather.read_table(path, use_threads=False).to_pandas(use_threads=False)
    except (pyarrow.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise RecordingError(_cannot_be_read(path, "Feather", error)) from error


def _cannot_be_read(path: Path, kind: str, error: BaseException) -> str:
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return f"{path} cannot be read as {kind}: {reason}"
