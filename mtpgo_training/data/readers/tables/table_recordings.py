# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plain tables of any column names: CSV and Parquet, one row for each time and road user."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import OWN_NAMES, ClassMap
from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.data.readers.checks.foreign_files import without_foreign
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.csv_table import (
    STANDARD_FORM,
    check_columns,
    check_thousands,
    column_name,
    observed_rows,
    read_header,
    read_table,
    require_columns,
    require_once,
)
from mtpgo_training.data.readers.drone_files import (
    NoRecordingsError,
    existing_directory,
    select_names,
    visible_files,
)
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.parquet_file import parquet_columns, read_parquet
from mtpgo_training.data.readers.tables.table_columns import (
    EXAMPLE,
    LENGTHS_M,
    SPEEDS_MPS,
    TIMES_S,
    TableColumns,
    read_columns,
)
from mtpgo_training.data.readers.tables.track_rows import (
    TableSource,
    as_file_name,
    recording_of_rows,
    velocity_from_speed,
)
from mtpgo_training.data.recording import Recording

_SUFFIXES = re.compile(r"\.(csv|tsv|txt)(\.gz)?$|\.(parquet|pq)$", re.IGNORECASE)
_TIME_OF_DAY = r"\s*([01]?\d|2[0-3]):[0-5]\d:[0-5]\d(\.\d+)?\s*"
_HOUR_BACK_S = (-3600.0, -3590.0)
"""Steps between two rows of a road user in the order of the file (s) where the clock is put back
by an hour; chosen: up to ten seconds after its last row."""

_NUMBERS = ("vx", "vy", "speed", "ax", "ay", "heading", "length", "width")


def table_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the tables in a directory, or one table.

    Args:
        directory: a directory with ``.csv``, ``.tsv``, ``.txt`` (also with ``.gz``) or
            ``.parquet`` files, or one file.
        names: names of the files wanted, without the suffix.
        options: the file that describes the columns, and the class map.

    Raises:
        ConfigurationError: no description of the columns, or one with a defect.
        RecordingError: no files.
    """
    if options.columns is None:
        raise ConfigurationError(
            "the layout 'table' needs --columns FILE, a YAML file that names the columns, "
            f"for example {EXAMPLE}"
        )
    columns = read_columns(options.columns)
    if directory.is_file():
        paths = [directory]
    else:
        existing_directory(directory)
        paths = visible_files(directory.iterdir(), directory)
        paths = [path for path in paths if _SUFFIXES.search(path.name)]
        if not paths:
            raise NoRecordingsError(
                f"{directory} has no tables, expected .csv, .tsv, .txt or .parquet files"
            )
    by_name: dict[str, Path] = {}
    for path in paths:
        name = _SUFFIXES.sub("", path.name)
        if name in by_name:
            raise RecordingError(
                f"{directory} has two tables of the name {name!r}, {by_name[name].name} and "
                f"{path.name}, expected one"
            )
        by_name[name] = path
    settings = {"columns": repr(columns)}
    units = [
        Unit(
            name,
            "table",
            (by_name[name],),
            functools.partial(_read, name, by_name[name], columns, options.classes),
            settings,
        )
        for name in select_names(list(by_name), names, directory)
    ]
    return units if names else without_foreign(units, functools.partial(_is_table, columns))


def _is_table(columns: TableColumns, path: Path) -> bool:
    """Return whether a text file has one of the columns; any Parquet file may have them."""
    if columns.names or path.suffix.lower() in (".parquet", ".pq"):
        return True
    wanted = columns.columns.given().values()
    return not set(wanted).isdisjoint(read_header(path, columns.form))


def _read(name: str, path: Path, columns: TableColumns, classes: ClassMap) -> Iterator[Recording]:
    table, unobserved = _rows(path, columns)
    parquet = path.suffix.lower() in (".parquet", ".pq")
    sha256 = sha256_of([path])
    groups = [("", table)]
    if columns.columns.recording:
        groups = [(str(key), rows) for key, rows in table.groupby("recording", sort=True)]
        _check_names(path, [key for key, _ in groups])
    for part, rows in groups:
        one = len(groups) == 1
        yield recording_of_rows(
            rows,
            TableSource(
                name=name if one else f"{name}-{part}",
                layout="table",
                files=(path,),
                sha256=sha256 if one else f"{sha256}#{part}",
                classes=classes,
                location=columns.location,
                frame_rate=columns.frame_rate,
                unit="row" if parquet else "line",
                unobserved=unobserved,
            ),
        )


def _check_names(path: Path, names: Sequence[str]) -> None:
    """Check that recordings have different names also where these are names of files.

    Raises:
        RecordingError: two have the same one.
    """
    taken: dict[str, str] = {}
    for name in names:
        other = taken.setdefault(as_file_name(name), name)
        if other != name:
            raise RecordingError(
                f"{path} has the recordings {other!r} and {name!r}, expected names that differ "
                "in more than '/' or '_'"
            )


def _rows(path: Path, columns: TableColumns) -> tuple[pd.DataFrame, Float64Array]:
    """Return the rows of a file in the internal frame, under the names of ``track_rows``.

    With them those of :func:`_checked`.
    """
    table, unobserved = _checked(path, columns)
    if not len(table):
        raise RecordingError(f"{path} has no rows, expected at least one")
    flip = -1.0 if columns.y_axis == "down" else 1.0
    length, speed = LENGTHS_M[columns.unit], SPEEDS_MPS[columns.speed_unit]
    factors = {"x": length, "y": length * flip, "length": length, "width": length}
    factors |= {"vx": speed, "ax": speed, "vy": speed * flip, "ay": speed * flip, "speed": speed}
    for column, factor in factors.items():
        if column in table:
            table[column] = table[column] * factor
    if "heading" in table:
        angle = table.pop("heading").to_numpy(np.float64)
        table["yaw"] = flip * (np.radians(angle) if columns.heading_unit == "deg" else angle)
    if "speed" in table:
        velocity = velocity_from_speed(
            table.pop("speed").to_numpy(np.float64), table["yaw"].to_numpy(np.float64)
        )
        table["vx"], table["vy"] = velocity[:, 0], velocity[:, 1]
    if "agent_class" in table:
        table = table.rename(columns={"agent_class": "class"})
    elif AgentClass.from_name(columns.agent_class) != AgentClass.UNKNOWN:
        table["class"] = columns.agent_class
    return table, unobserved


def _checked(path: Path, columns: TableColumns) -> tuple[pd.DataFrame, Float64Array]:
    """Return the columns under their meanings, as numbers and texts, and the line of each row.

    With them the times (s) or frame numbers of the rows without a position, which are left out.
    """
    given = columns.columns.given()
    dates, lasting = columns.time_unit == "date", False
    wanted = list(given.values())
    unit, first_line = "line", columns.form.first_line
    if path.suffix.lower() in (".parquet", ".pq"):
        unit, first_line = "row", 1
        written = parquet_columns(path)
        header = [column_name(name) for name in written]
        require_columns(path, header, wanted, wanted)
        require_once(path, header, wanted)
        table = read_parquet(path, [written[header.index(name)] for name in wanted])
        table.columns = pd.Index(wanted)
        # Dates and durations are such, whatever unit numbers would have.
        kind = table[given["time"]].dtype if "time" in given else None
        lasting = pd.api.types.is_timedelta64_dtype(kind)
        dates = not lasting and (dates or pd.api.types.is_datetime64_any_dtype(kind))
        if lasting:
            table[given["time"]] = table[given["time"]].dt.total_seconds()
    else:
        texts = [given[name] for name in ("track", "agent_class", "recording") if name in given]
        texts += [given["time"]] if "time" in given and dates else []
        numbers = [name for name in wanted if name not in texts]
        check_thousands(path, columns.form, numbers)
        table = read_table(path, texts=texts, unchecked=numbers, form=columns.form)
        if columns.decimal == ",":
            # Names that were written as numbers: 3,0 is 3, as 3.0 is elsewhere.
            table[texts] = table[texts].replace(r"^(\s*\d+),(0+\s*)$", r"\1.\2", regex=True)
    instants = table[given["time"] if "time" in given else given["frame"]]
    position = [given["x"], given["y"]]
    form = STANDARD_FORM if unit == "row" else columns.form
    table = observed_rows(table, path, position, first_line=first_line, unit=unit, form=form)
    check_columns(
        table,
        path,
        integers=[given["frame"]] if "frame" in given else [],
        numbers=[given["time"]] if "time" in given and not dates else [],
        unknown_allowed=[given[name] for name in _NUMBERS if name in given],
        first_line=first_line,
        unit=unit,
        form=form,
        described=True,
    )
    instants = instants.drop(table.index)
    table = table.rename(columns={column: name for name, column in given.items()})
    table["line"] = table.index.to_numpy() + first_line
    table = table.reset_index(drop=True)
    source = TableSource(path.name, "table", (path,), "", OWN_NAMES, unit=unit)
    if "recording" in table:
        table["recording"] = table["recording"].astype("string").fillna("").str.strip()
        bad = (table["recording"] == "").to_numpy(bool)
        if bad.any():
            place = source.place_of(table, int(np.argmax(bad)))
            raise RecordingError(f"{place}: the recording has no name, expected one in each row")
    if "time" in table:
        factor = 1.0 if lasting else TIMES_S[columns.time_unit]
        table["time_s"] = _dates(table, source) if dates else table["time"] * factor
        if dates:
            return table, _seconds_of(instants).dropna().to_numpy(np.float64)
        return table, _known_numbers(instants) * factor
    return table, _known_numbers(instants)


def _known_numbers(column: pd.Series) -> Float64Array:
    """Return the numbers in a column that was not checked."""
    numbers = pd.to_numeric(column.astype("string"), errors="coerce")
    values = numbers.to_numpy(np.float64, na_value=np.nan)
    return np.asarray(values[np.isfinite(values)])


def _seconds_of(column: pd.Series) -> pd.Series:
    """Return the seconds since 1970 of dates, of times of day since midnight, NaN for others."""
    if not pd.api.types.is_datetime64_any_dtype(column):
        # ISO 8601 allows a decimal comma, which Python's log writes; pandas does not know it.
        column = column.astype("string").str.replace(r"(?<=\d),(?=\d)", ".", regex=True)
        if column.str.fullmatch(_TIME_OF_DAY).fillna(True).all():
            return pd.to_timedelta(column).dt.total_seconds()
    times = pd.to_datetime(column, errors="coerce", utc=True, format="ISO8601")
    whole = times.dt.tz_localize(None).astype("datetime64[ns]")
    return (whole.astype(np.int64) / 1e9).where(times.notna())


def _dates(table: pd.DataFrame, source: TableSource) -> pd.Series:
    """Return the seconds of the dates or times of day in the column ``time``."""
    times = _seconds_of(table["time"])
    bad = times.isna().to_numpy(bool)
    if bad.any():
        row = int(np.argmax(bad))
        cell = table["time"].iloc[row]
        given = "an empty cell" if pd.isna(cell) else repr(str(cell))
        raise RecordingError(
            f"{source.place_of(table, row)}: the time {given}, expected a date and time such as "
            "2024-05-01T12:00:00.1, or a time of day such as 12:00:00.1 in all rows"
        )
    steps_s = (
        times.groupby(table["track"].astype("string"), sort=False).diff().to_numpy(np.float64)
    )
    back = (steps_s < _HOUR_BACK_S[1]) & (steps_s >= _HOUR_BACK_S[0])
    if back.any() and not (steps_s[~back] < 0.0).any():  # which rows in no order would have
        remark(
            f"{source.place_of(table, int(np.argmax(back)))}: the dates go back by an hour, as"
            " local times do when summer time ends; expected their difference from UTC, such as"
            " +01:00"
        )
    return times
