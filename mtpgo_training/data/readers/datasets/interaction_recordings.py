# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""INTERACTION and SinD: a table of the vehicles and one of the pedestrians of each recording.

Both have x and y of the box centre in a site frame with y up, and counter-clockwise angles in
radians. INTERACTION's later edition has many short cases in one file. SinD gives the direction of
motion (``heading_rad``) beside that of the box (``yaw_rad``), which is the one read here.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers.csv_table import read_header, read_table
from mtpgo_training.data.readers.drone_files import select_names
from mtpgo_training.data.readers.file_groups import grouped_files
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import TableSource, recording_of_rows
from mtpgo_training.data.recording import Recording

_INTERACTION = re.compile(
    r"(?:(?P<kind>vehicle|pedestrian)_tracks_)?(?P<name>.+)\.csv(?:\.gz)?", re.IGNORECASE
)
_SIND = re.compile(r"(?P<kind>veh|ped)_smoothed_tracks\.csv(?:\.gz)?", re.IGNORECASE)

SIND_CLASSES = ClassMap(
    {
        "tricycle": AgentClass.MOTORCYCLE,
        "pedestrain": AgentClass.PEDESTRIAN,
    }
)
"""Classes of SinD that have other names here, one of them misspelt in its files. Its tricycles
carry goods or passengers in traffic as motorcycles do."""

_OPTIONAL = ("vx", "vy", "ax", "ay", "psi_rad", "yaw_rad", "length", "width")


def interaction_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the recordings of INTERACTION below a directory, named after folder and number.

    Args:
        directory: a directory with ``vehicle_tracks_NNN.csv`` and ``pedestrian_tracks_NNN.csv``,
            or with files that have a column ``case_id``.
        names: names of those wanted.
        options: the class map.

    Raises:
        RecordingError: there are none.
    """
    expected = "INTERACTION's vehicle_tracks_000.csv or files with a column case_id"
    found = grouped_files(directory, _INTERACTION, expected, _is_interaction)
    return _units("interaction", found, names, directory, options.classes)


def sind_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the recordings of SinD below a directory, named after their folder.

    Args:
        directory: a directory with ``Veh_smoothed_tracks.csv`` and ``Ped_smoothed_tracks.csv``,
            or with one such folder for each recording.
        names: names of those wanted.
        options: the class map.

    Raises:
        RecordingError: there are none.
    """
    found = grouped_files(directory, _SIND, "SinD's Veh_smoothed_tracks.csv in each folder")
    classes = options.classes if options.class_map else SIND_CLASSES
    return _units("sind", found, names, directory, classes)


def _is_interaction(path: Path) -> bool:
    if "_tracks_" in path.name:
        return True
    try:
        return {"case_id", "track_id"} <= set(read_header(path))
    except RecordingError:
        return False  # some other file beside them


def _units(
    layout: str,
    found: Mapping[str, Mapping[str, Path]],
    names: Sequence[str] | None,
    directory: Path,
    classes: ClassMap,
) -> list[Unit]:
    read = functools.partial(_read, layout=layout, classes=classes)
    return [
        Unit(name, layout, tuple(files), functools.partial(read, name, tuple(files)))
        for name in select_names(list(found), names, directory)
        # Vehicles first: "vehicle" and "veh" come after "pedestrian" and "ped".
        for files in [[found[name][kind] for kind in sorted(found[name], reverse=True)]]
    ]


def _read(name: str, files: Sequence[Path], layout: str, classes: ClassMap) -> Iterator[Recording]:
    table = pd.concat(
        [_rows(path).assign(file=number) for number, path in enumerate(files)], ignore_index=True
    )
    sha256 = sha256_of(files)
    groups = [("", table)]
    if "case_id" in table:
        groups = [(f"{case:g}", rows) for case, rows in table.groupby("case_id", sort=True)]
    for part, rows in groups:
        yield recording_of_rows(
            rows,
            TableSource(
                name=f"{name}-{part}" if part else name,
                layout=layout,
                files=files,
                sha256=f"{sha256}#{part}" if part else sha256,
                classes=classes,
                location=files[0].resolve().parent.name,
            ),
        )


def _rows(path: Path) -> pd.DataFrame:
    cases = "case_id" in read_header(path)
    table = read_table(
        path,
        numbers=("timestamp_ms", "x", "y", *(("case_id",) if cases else ())),
        unknown_allowed=_OPTIONAL,
        texts=("track_id", "agent_type"),
        optional=_OPTIONAL,
    )
    table["line"] = np.arange(len(table)) + 2
    table["time_s"] = table.pop("timestamp_ms") / 1000.0
    yaw = "psi_rad" if "psi_rad" in table else "yaw_rad"
    return table.rename(columns={"track_id": "track", "agent_type": "class", yaw: "yaw"})
