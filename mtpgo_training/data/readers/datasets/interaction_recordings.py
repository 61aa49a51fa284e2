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
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers.csv_table import read_header, read_table
from mtpgo_training.data.readers.drone_files import select_names
from mtpgo_training.data.readers.file_groups import GENERIC, grouped_files
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import TableSource, recording_of_rows
from mtpgo_training.data.recording import Recording

_INTERACTION = re.compile(
    r"(?:(?P<kind>vehicle|pedestrian|person)_tracks_)?(?P<name>.+)\.csv(?:\.gz)?", re.IGNORECASE
)
_SIND = re.compile(r"(?P<kind>veh|ped)_smoothed_tracks\.csv(?:\.gz)?", re.IGNORECASE)

SIND_CLASSES = ClassMap(
    {
        "tricycle": AgentClass.MOTORCYCLE,
        "tricycles": AgentClass.MOTORCYCLE,
        "pedestrain": AgentClass.PEDESTRIAN,
    }
)
"""Classes of SinD that have other names here, one of them misspelt in its files. Its tricycles
carry goods or passengers in traffic as motorcycles do."""

_SPLITS = re.compile(r"_(?:train|val|test|obs|challenge)$", re.IGNORECASE)
"""What a file of cases has behind the name of its site."""

_SAME_NUMBER = re.compile(r"\.0+$")
"""End of a number as some tools write it: 3.0 is 3."""

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
    return _units("interaction", found, names, directory, options.classes, _interaction_site)


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
    site = functools.partial(_sind_site, directory)
    return _units("sind", found, names, directory, classes, site)


def _interaction_site(path: Path) -> str:
    """Return the site: the folder of the first edition's files, the name of a file of cases."""
    name = _INTERACTION.fullmatch(path.name)
    if name is not None and name["kind"] is None:
        return _SPLITS.sub("", name["name"])
    return path.resolve().parent.name


def _sind_site(directory: Path, path: Path) -> str:
    """Return the city, a folder with one folder for each recording; empty where there is none."""
    above = path.parent.parent
    inside = above != directory and directory in above.parents
    return above.name if inside and above.name.lower() not in GENERIC else ""


def _is_interaction(path: Path) -> bool:
    name = _INTERACTION.fullmatch(path.name)
    if name is not None and name["kind"] is not None:
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
    site: Callable[[Path], str],
) -> list[Unit]:
    read = functools.partial(_read, layout=layout, classes=classes, site=site)
    return [
        Unit(
            name,
            layout,
            tuple(files),
            functools.partial(read, name, tuple(files)),
            {"location": site(files[0])},  # of the folder, not of what is in the files
        )
        for name in select_names(list(found), names, directory)
        # Vehicles first: "vehicle" and "veh" come after "pedestrian" and "ped".
        for files in [[found[name][kind] for kind in sorted(found[name], reverse=True)]]
    ]


def _read(
    name: str,
    files: Sequence[Path],
    layout: str,
    classes: ClassMap,
    site: Callable[[Path], str],
) -> Iterator[Recording]:
    tables = [_rows(path).assign(file=number) for number, path in enumerate(files)]
    table = pd.concat(_told_apart(tables), ignore_index=True)
    sha256 = sha256_of(files)
    groups = [("", table)]
    if "case_id" in table:
        groups = [
            (np.format_float_positional(case, trim="-"), rows)
            for case, rows in table.groupby("case_id", sort=True)
        ]
    for part, rows in groups:
        yield recording_of_rows(
            rows,
            TableSource(
                name=f"{name}-{part}" if part else name,
                layout=layout,
                files=files,
                sha256=f"{sha256}#{part}" if part else sha256,
                classes=classes,
                location=site(files[0]),
            ),
        )


def _told_apart(tables: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """Return the tables with tracks whose numbers are in one of them only.

    The pedestrians' numbers begin with P in both data sets; where they do not, they are those of
    vehicles as well.
    """
    seen: set[str] = set()
    found = []
    for table in tables:
        track = table["track"].str.strip()
        numbers = set(track.str.replace(_SAME_NUMBER, "", regex=True))
        found.append(table.assign(track="P" + track) if numbers & seen else table)
        seen |= numbers
    return found


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
