# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The forms of NGSIM files: with and without a header line, by commas or blanks, feet or metres.

The archives of the US Department of Transportation hold each period as a text file without a
header line, with 18 columns (motorways) or 24 (arterials) separated by blanks, and some of them
as CSV as well. Its portal exports all sites as one CSV file, from its table view with
``1,118,846,979,700`` in quotes. The capitals of the column names differ.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.csv_lines import separator_of
from mtpgo_training.data.readers.csv_table import (
    CsvForm,
    cells_of,
    first_lines_of,
    read_header,
)

FOOT_M = 0.3048
"""An international foot (m)."""

SUFFIXES = (".csv", ".csv.gz", ".txt", ".txt.gz")
"""Endings of file names, in lower case, of which the first takes precedence where a recording is
there in several forms."""

_BEGIN = (
    "vehicle_id",
    "frame_id",
    "total_frames",
    "global_time",
    "local_x",
    "local_y",
    "global_x",
    "global_y",
    "v_length",
    "v_width",
    "v_class",
    "v_vel",
    "v_acc",
    "lane_id",
)
_ARTERIAL = ("o_zone", "d_zone", "int_id", "section_id", "direction", "movement")
_END = ("preceding", "following", "space_headway", "time_headway")
_WITHOUT_HEADER = {
    18: (*_BEGIN, *_END),
    24: (*_BEGIN, *_ARTERIAL, *_END),
    25: (*_BEGIN, *_ARTERIAL, *_END, "location"),
}
"""Column names of files without a header line, by their number."""

_SYNONYMS = {"mean_speed": "v_vel"}
_UNIT = re.compile(r"\s*[(\[]\s*(?P<unit>[a-z/]*)\s*[)\]]\s*$")


@dataclass(frozen=True)
class NgsimForm:
    """How one file is written.

    Attributes:
        csv: its cells.
        spelling: the file's column by the name in lower case with underscores.
        unit_m: length of its unit (m).
    """

    csv: CsvForm
    spelling: Mapping[str, str]
    unit_m: float

    def spelled(self, names: Sequence[str]) -> list[str]:
        """Return the names as the file writes them."""
        return [self.spelling.get(name, name) for name in names]


def find_form(path: Path) -> NgsimForm:
    """Return the form of an NGSIM file.

    Raises:
        RecordingError: the file cannot be read, is empty, or has another number of columns
            without a header line.
    """
    lines = first_lines_of(path, 2)
    if not lines:
        raise RecordingError(f"{path} is empty, expected NGSIM trajectories")
    mark = separator_of(lines[0])
    cells = cells_of(lines[0], mark)
    if _is_number(cells[0]):
        if len(cells) not in _WITHOUT_HEADER:
            raise RecordingError(
                f"{path} has {len(cells)} columns and no header line, expected "
                f"{', '.join(map(str, _WITHOUT_HEADER))} columns or a header line"
            )
        names = _WITHOUT_HEADER[len(cells)]
        csv = CsvForm(separator=mark, names=names)
        return NgsimForm(csv, {name: name for name in names}, FOOT_M)
    csv = CsvForm(
        separator="\t" if mark == "\t" else ",",
        thousands="," if any('"' in line or mark != "," for line in lines[1:]) else None,
    )
    spelling: dict[str, str] = {}
    unit_m = FOOT_M
    for column in read_header(path, csv):
        name = column.lower()
        unit = _UNIT.search(name)
        name = re.sub(r"\s+", "_", _UNIT.sub("", name).strip())
        if name == "local_x" and unit is not None and unit["unit"] in ("m", "meter", "metre"):
            unit_m = 1.0
        spelling.setdefault(_SYNONYMS.get(name, name), column)
    return NgsimForm(csv, spelling, unit_m)


def may_be_ngsim(path: Path) -> bool:
    """Return whether a file may have trajectories: others lie beside them in the archives."""
    lines = first_lines_of(path, 1)
    if not lines:
        return False
    cells = lines[0].replace(",", " ").split()
    return "local_x" in lines[0].lower().replace(" ", "_") or (
        len(cells) >= min(_WITHOUT_HEADER) - 4 and all(_is_number(cell) for cell in cells)
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
