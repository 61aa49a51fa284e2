# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Guesses which layout the files of a directory have, for error messages only."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from mtpgo_core.errors import RecordingError, found_names
from mtpgo_training.data.readers.drone_files import detect_layout

_MOST_FILES = 2000
"""Files that are looked at by their names; chosen, a data set's first folders have fewer."""

_MOST_HEADERS = 20
"""Files of any name whose first line is looked at; chosen."""

_MOST_NAMES = 3
"""Files that a sentence lists; chosen."""

_BY_NAME = (
    (
        re.compile(r"(vehicle|pedestrian|person)_tracks_\d+\.csv(\.gz)?", re.IGNORECASE),
        "interaction",
    ),
    (re.compile(r"(veh|ped)_smoothed_tracks\.csv(\.gz)?", re.IGNORECASE), "sind"),
    (re.compile(r".+_traj_(ped|veh)_filtered\.csv(\.gz)?", re.IGNORECASE), "dut"),
    (re.compile(r"obsmat\.txt", re.IGNORECASE), "eth_ucy"),
    (re.compile(r"sample_annotation\.json"), "nuscenes"),
    (re.compile(r"scenario_.+\.parquet|annotations\.feather", re.IGNORECASE), "argoverse2"),
    (re.compile(r".*\.tfrecord.*", re.IGNORECASE), "waymo"),
    (re.compile(r".+\.(mcap|db3|bag)", re.IGNORECASE), "bag"),
)
"""Names of files -> the layout that has them."""

_TEXT = re.compile(r".+\.(csv|txt)(\.gz)?", re.IGNORECASE)

_ALIKE = {"round": "ind", "unid": "ind", "citr": "dut"}
"""Layouts whose files do not differ from those of another one."""


def contents_in_words(directory: Path, layout: str) -> str:
    """Return what a directory contains instead of recordings of a layout, "" if it is empty.

    Args:
        directory: the directory, or a single file.
        layout: the layout that was asked for.
    """
    if directory.is_file():
        other = other_layout_of(directory, layout)
        return f"it is of the layout {other!r}" if other else ""
    asked = _ALIKE.get(layout, layout)
    headers = 0
    names: list[str] = []
    others: dict[str, Path] = {}
    for path in _files(directory):
        names.append(str(path.relative_to(directory)))
        found = _layout_of_name(path)
        if found is None and _TEXT.fullmatch(path.name) and headers < _MOST_HEADERS:
            headers += 1
            found = layout_of_header(path)
        if found == asked and path.parent != directory:
            return f"there are such files in {path.parent}"
        if found is not None and found != asked:
            others.setdefault(found, path)
    for found, path in others.items():
        return f"{path} is of the layout {found!r}"
    return f"it has {found_names(names, _MOST_NAMES)}" if names else ""


def other_layout_of(path: Path, layout: str) -> str:
    """Return the layout of a file if it is not the wanted one, else ""."""
    found = _layout_of_name(path)
    if found is None and _TEXT.fullmatch(path.name):
        found = layout_of_header(path)
    return found if found is not None and found != _ALIKE.get(layout, layout) else ""


def layout_of_header(path: Path) -> str | None:
    """Return the layout that the first lines of a text file show, None if they show none."""
    # Imported here: it loads pandas, which would delay completion in the shell.
    from mtpgo_training.data.readers.csv_table import first_lines_of

    try:
        found = detect_layout(path)
        if found is None and any(
            line.startswith("Time,") and ",E1," in line for line in first_lines_of(path, 20)
        ):
            found = "openacc"
    except (RecordingError, OSError):
        return None
    return found


def _layout_of_name(path: Path) -> str | None:
    return next((layout for name, layout in _BY_NAME if name.fullmatch(path.name)), None)


def _files(directory: Path) -> Iterator[Path]:
    """Yield the first files in a directory and the folders below it, without hidden ones."""
    count = 0
    for folder, folders, names in os.walk(directory):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            if not name.startswith("."):
                count += 1
                yield Path(folder, name)
            if count >= _MOST_FILES:
                return
