# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""ETH and UCY: pedestrians at 2.5 Hz, as ``obsmat.txt`` or as text of four columns.

``obsmat.txt`` has frame, number, x, z, y and the velocity along the same three axes; the text that
benchmarks use has frame, number, x and y. Both are separated by blanks or tabs and have no header
line. Positions are metres on the ground. Frames are those of the video, every sixth or tenth of
which was annotated; whatever the usual step of a pedestrian is, it is 0.4 s.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mtpgo_core.class_map import OWN_NAMES
from mtpgo_training.data.readers.csv_lines import separator_of
from mtpgo_training.data.readers.csv_table import (
    CsvForm,
    cells_of,
    first_lines_of,
    read_table,
)
from mtpgo_training.data.readers.drone_files import select_names
from mtpgo_training.data.readers.file_groups import grouped_files
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.frame_grid import without_common_step
from mtpgo_training.data.readers.tables.track_rows import TableSource, recording_of_rows
from mtpgo_training.data.recording import Int64Array, Recording

FRAME_RATE = 2.5
"""Annotations per second of each pedestrian (Hz)."""

_NAMES = {
    4: ("frame", "track", "x", "y"),
    8: ("frame", "track", "x", "z", "y", "vx", "vz", "vy"),
}
_FILES = re.compile(r"(?:obsmat|(?P<name>.+?))\.txt(?:\.gz)?", re.IGNORECASE)
_OTHERS = {"groups.txt", "destinations.txt", "obstacles.txt", "h.txt", "info.txt", "readme.txt"}
"""Files beside the annotations in the archives."""
_PIXELS = re.compile(r"(?:^|_)(?:px|pixels?)(?:\d*$|_)", re.IGNORECASE)
"""In the name of a file: its positions are those in the image."""


def eth_units(directory: Path, names: Sequence[str] | None, options: ReadingOptions) -> list[Unit]:
    """Return the recordings of ETH and UCY below a directory, named after file or folder.

    Args:
        directory: a directory with ``obsmat.txt`` or text files of four columns.
        names: names of those wanted.
        options: not used, all are pedestrians.

    Raises:
        RecordingError: there are none.
    """
    expected = "ETH's obsmat.txt or text files of frame, number, x and y"
    found = grouped_files(directory, _FILES, expected, lambda path: _form(path) is not None)
    return [
        Unit(name, "eth_ucy", (path,), functools.partial(_read, name, path))
        for name in select_names(list(found), names, directory)
        for path in found[name].values()
    ]


def _is_beside(name: str) -> bool:
    """Return whether a file is none of positions on the ground."""
    stem = name.lower().removesuffix(".gz").removesuffix(".txt")
    return f"{stem}.txt" in _OTHERS or _PIXELS.search(stem) is not None


def _form(path: Path) -> CsvForm | None:
    """Return the form of a file of annotations, None for other text."""
    lines = first_lines_of(path, 1)
    if not lines or _is_beside(path.name):
        return None
    mark = separator_of(lines[0].strip())
    mark = " " if mark == "\t" else mark  # blanks stand around the tabs of some files
    cells = cells_of(lines[0].strip(), mark)
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return None
    return CsvForm(separator=mark, names=_NAMES[len(cells)]) if len(cells) in _NAMES else None


def _read(name: str, path: Path) -> Iterator[Recording]:
    form = _form(path) or CsvForm(separator=" ", names=_NAMES[4])
    table = read_table(
        path,
        integers=("frame", "track"),
        numbers=("x", "y"),
        unknown_allowed=("vx", "vy"),
        optional=("vx", "vy"),
        form=form,
    )
    table["line"] = np.arange(len(table)) + form.first_line
    table["class"] = "pedestrian"
    table["frame"], _ = without_common_step(table["frame"].to_numpy(np.int64), FRAME_RATE)
    usual = _usual_step(table["frame"].to_numpy(np.int64), table["track"].to_numpy(np.int64))
    yield recording_of_rows(
        table,
        TableSource(
            name=name,
            layout="eth_ucy",
            files=(path,),
            sha256=sha256_of([path]),
            classes=OWN_NAMES,
            location=name,
            frame_rate=FRAME_RATE * usual,
        ),
    )


def _usual_step(frame: Int64Array, track: Int64Array) -> int:
    """Return the most frequent step between two rows of a track, the shortest of several.

    It is more than the common one where not all pedestrians were annotated in the same frames.
    """
    order = np.lexsort((frame, track))
    steps = np.diff(frame[order])[np.diff(track[order]) == 0]
    found, count = np.unique(steps[steps > 0], return_counts=True)
    return int(found[np.argmax(count)]) if len(found) else 1
