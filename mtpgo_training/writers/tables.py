# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The three CSV files of a recording, written as a whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd

from mtpgo_core.errors import RecordingError


def write_tables(
    directory: Path,
    name: str,
    *,
    tracks: pd.DataFrame,
    tracks_meta: pd.DataFrame,
    recording_meta: pd.DataFrame,
    compress: bool,
) -> list[Path]:
    """``NN_tracks``, ``NN_tracksMeta`` and ``NN_recordingMeta``.

    Args:
        directory: made if it is missing.
        name: the recording's name, ``NN``.
        tracks: one row per frame and road user, columns in the layout's order.
        tracks_meta: one row per road user.
        recording_meta: one row.
        compress: write the tracks as ``.csv.gz``.

    Returns:
        The paths written.

    Raises:
        RecordingError: the directory cannot be written to.
    """
    written = []
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for kind, table, packed in (
            ("tracks", tracks, compress),
            ("tracksMeta", tracks_meta, False),
            ("recordingMeta", recording_meta, False),
        ):
            path = directory / f"{name}_{kind}.csv{'.gz' if packed else ''}"
            beside = path.with_name(f".{path.name}.{os.getpid()}")
            try:
                table.to_csv(
                    beside,
                    index=False,
                    # A fixed time keeps the packed bytes the same for the same content.
                    compression={"method": "gzip", "mtime": 1} if packed else None,
                )
                beside.replace(path)
            finally:
                beside.unlink(missing_ok=True)
            written.append(path)
    except OSError as error:
        raise RecordingError(f"{directory} cannot be written to: {error.strerror}") from error
    return written
