# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""DUT and CITR: pedestrians and vehicles seen from above, in tables of their own.

Positions are metres in image axes, y down, and so are the vehicles' headings. A vehicle has a
speed along its heading. The numbers of pedestrians and vehicles overlap, so a track is named
``p3`` or ``v3``.
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
from mtpgo_training.data.readers.tables.track_rows import (
    TableSource,
    recording_of_rows,
    velocity_from_speed,
)
from mtpgo_training.data.recording import Recording

FRAME_RATES = {"dut": 24000 / 1001, "citr": 30000 / 1001}
"""Frames per second of the videos (Hz), as the data sets say: 23.98 and 29.97."""

CLASSES = ClassMap({"ped": AgentClass.PEDESTRIAN, "veh": AgentClass.CAR})
"""Classes by the column ``label``."""

_FILES = re.compile(r"(?P<name>.+)_traj_(?P<kind>ped|veh)_filtered\.csv(?:\.gz)?", re.IGNORECASE)


_PIXELS = {"x", "x_c", "x_measure"}
"""Columns of the first edition, all of whose positions are pixels."""


def crowd_units(
    layout: str, directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the recordings of DUT or CITR below a directory.

    Args:
        layout: ``dut`` or ``citr``.
        directory: a directory with ``NAME_traj_ped_filtered.csv`` and
            ``NAME_traj_veh_filtered.csv``; either may be missing.
        names: names of those wanted.
        options: the class map.

    Raises:
        RecordingError: there are none.
    """
    found = grouped_files(directory, _FILES, "files such as 01_traj_ped_filtered.csv")
    classes = options.classes if options.class_map else CLASSES
    return [
        Unit(
            name,
            layout,
            tuple(found[name].values()),
            functools.partial(_read, name, found[name], layout, classes),
        )
        for name in select_names(list(found), names, directory)
    ]


def _read(
    name: str, files: Mapping[str, Path], layout: str, classes: ClassMap
) -> Iterator[Recording]:
    paths = tuple(files.values())
    tables = [
        _rows(path, kind).assign(file=number) for number, (kind, path) in enumerate(files.items())
    ]
    yield recording_of_rows(
        pd.concat(tables, ignore_index=True),
        TableSource(
            name=name,
            layout=layout,
            files=paths,
            sha256=sha256_of(paths),
            classes=classes,
            location=name.rpartition("_")[0],
            frame_rate=FRAME_RATES[layout],
        ),
    )


def _rows(path: Path, kind: str) -> pd.DataFrame:
    pixels = sorted(_PIXELS & set(read_header(path)))
    if pixels:
        raise RecordingError(
            f"{path} is of the data set's first edition, whose positions are pixels (it has the "
            f"column {pixels[0]!r}), expected the later one in metres"
        )
    motion = ("vx_est", "vy_est") if kind == "ped" else ("psi_est", "vel_est")
    table = read_table(
        path,
        integers=("id", "frame"),
        numbers=("x_est", "y_est"),
        unknown_allowed=motion,
        texts=("label",),
        optional=motion,
    )
    table["line"] = np.arange(len(table)) + 2
    table["track"] = kind[0] + table["id"].astype(str)
    table["x"], table["y"] = table["x_est"], -table["y_est"]
    if "vx_est" in table and "vy_est" in table:
        table["vx"], table["vy"] = table["vx_est"], -table["vy_est"]
    if "psi_est" in table:
        table["yaw"] = -table["psi_est"]
        if "vel_est" in table:
            velocity = velocity_from_speed(
                table["vel_est"].to_numpy(np.float64), table["yaw"].to_numpy(np.float64)
            )
            table["vx"], table["vy"] = velocity[:, 0], velocity[:, 1]
    return table.rename(columns={"label": "class"})
