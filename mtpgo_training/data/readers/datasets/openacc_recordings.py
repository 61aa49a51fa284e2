# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""OpenACC: platoons of cars with satellite receivers, all cars of an instant in one row.

Five lines with facts of the trip come before the column names. Car ``k`` has its position in the
columns ``Ek`` and ``Nk`` (metres east and north of a common origin) and, in some campaigns, its
velocity in ``VEk`` and ``VNk``. Positions are those of the receiver; size and heading are not
given. Where a car has no position, it was not observed.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import OWN_NAMES
from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.checks.foreign_files import without_foreign
from mtpgo_training.data.readers.csv_lines import SEPARATORS, wrong_separator
from mtpgo_training.data.readers.csv_table import CsvForm, first_lines_of, read_header, read_table
from mtpgo_training.data.readers.drone_files import select_names
from mtpgo_training.data.readers.file_groups import grouped_files
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import TableSource, recording_of_rows
from mtpgo_training.data.recording import Recording

_FILES = re.compile(r"(?P<name>.+)\.csv(?:\.gz)?", re.IGNORECASE)
_MOST_FACTS = 20
"""Lines among which the one with the column names is looked for; chosen, the files have five
lines before it."""


def openacc_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the recordings of OpenACC below a directory.

    Args:
        directory: a directory with the campaign's ``.csv`` files.
        names: names of those wanted.
        options: not used, all are cars.

    Raises:
        RecordingError: there are none.
    """
    found = grouped_files(directory, _FILES, "OpenACC's .csv files")
    units = [
        Unit(
            name,
            "openacc",
            (path,),
            functools.partial(_read, name, path),
            {"location": _campaign(path)},  # of the folder, not of what is in the file
        )
        for name in select_names(list(found), names, directory)
        for path in found[name].values()
    ]
    return units if names else without_foreign(units, _may_be_openacc)


def _may_be_openacc(path: Path) -> bool:
    return any(_names_line(path, mark) is not None for mark in SEPARATORS)


def _campaign(path: Path) -> str:
    """Return the campaign, the folder that a file is in."""
    return path.resolve().parent.name


def _names_line(path: Path, separator: str = ",") -> int | None:
    """Return the index of the line with the column names, None if there is none."""
    lines = first_lines_of(path, _MOST_FACTS, blank=True)
    heads = [i for i, line in enumerate(lines) if _first_cell(line, separator) == "Time"]
    return heads[0] if heads else None


def _first_cell(line: str, separator: str) -> str:
    return line.split(separator)[0].strip().strip('"')


def _read(name: str, path: Path) -> Iterator[Recording]:
    head = _names_line(path)
    if head is None:
        for mark in SEPARATORS:
            if _names_line(path, mark) is not None:
                raise RecordingError(wrong_separator(path, mark, ","))
        raise RecordingError(
            f"{path} has no line of column names that begins with 'Time' among its first "
            f"{_MOST_FACTS}, expected a file of OpenACC"
        )
    blank = sum(1 for line in first_lines_of(path, head, blank=True) if not line.strip())
    form = CsvForm(skipped=head, blank=blank)
    header = read_header(path, form)
    cars = [c[1:] for c in header if re.fullmatch(r"E\d+", c) and f"N{c[1:]}" in header]
    if not cars:
        raise RecordingError(f"{path} has no columns 'E1' and 'N1', expected a file of OpenACC")
    velocity = [c for k in cars for c in (f"VE{k}", f"VN{k}")]
    wide = read_table(
        path,
        numbers=("Time",),
        unknown_allowed=[*(c for k in cars for c in (f"E{k}", f"N{k}")), *velocity],
        optional=velocity,
        form=form,
    )
    table = pd.concat([_car(wide, k, form.first_line) for k in cars], ignore_index=True)
    if not len(table):
        raise RecordingError(
            f"{path} has no position of a car in its {len(wide)} rows, expected values in 'E1' and"
            " 'N1'"
        )
    yield recording_of_rows(
        table,
        TableSource(
            name=name,
            layout="openacc",
            files=(path,),
            sha256=sha256_of([path]),
            classes=OWN_NAMES,
            location=_campaign(path),
        ),
    )


def _car(wide: pd.DataFrame, number: str, first_line: int) -> pd.DataFrame:
    """Return the rows in which a car has a position."""
    table = pd.DataFrame(
        {
            "track": int(number),
            "time_s": wide["Time"],
            "x": wide[f"E{number}"],
            "y": wide[f"N{number}"],
            "class": "car",
            "line": np.arange(len(wide)) + first_line,
        }
    )
    if f"VE{number}" in wide and f"VN{number}" in wide:
        table["vx"], table["vy"] = wide[f"VE{number}"], wide[f"VN{number}"]
    return table[np.isfinite(table[["x", "y"]]).all(axis=1)]
