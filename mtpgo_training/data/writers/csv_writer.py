# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The three CSV files of a recording, written as a whole or not at all."""

from __future__ import annotations

import tempfile
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
    """Write ``NN_tracks``, ``NN_tracksMeta`` and ``NN_recordingMeta``.

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
        # A packed file contains its own name, so it is written under that name in another folder.
        with tempfile.TemporaryDirectory(prefix=f".{name}_", dir=directory) as temporary:
            for kind, table, packed in (
                ("tracks", tracks, compress),
                ("tracksMeta", tracks_meta, False),
                ("recordingMeta", recording_meta, False),
            ):
                path = directory / f"{name}_{kind}.csv{'.gz' if packed else ''}"
                table.to_csv(
                    Path(temporary) / path.name,
                    index=False,
                    # A fixed time keeps the packed bytes the same for the same content.
                    compression={"method": "gzip", "mtime": 1} if packed else None,
                )
                (Path(temporary) / path.name).replace(path)
                written.append(path)
    except OSError as error:
        raise RecordingError(f"{directory} cannot be written to: {error.strerror}") from error
    return written
