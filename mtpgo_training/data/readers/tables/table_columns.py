# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file that describes the columns of a plain table: ``--columns columns.yaml``."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, from_dict, option, require
from mtpgo_core.schema import AgentClass
from mtpgo_core.yaml_file import read_yaml
from mtpgo_training.data.readers.csv_table import CsvForm, column_name

LENGTHS_M = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "yd": 0.9144}
"""Units of lengths (m); foot and yard are the international ones."""

TIMES_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "date": 1.0}
"""Units of times (s); ``date`` stands for dates with times of day, as ISO 8601 writes them."""

SPEEDS_MPS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "ft/s": 0.3048, "kn": 1852 / 3600}
"""Units of speeds (m/s)."""

_NO_MARKS = '+-"\r\n\0'
"""Marks that stand in numbers, or around and between cells in any file."""

EXAMPLE = "columns: {track: id, time: t, x: x, y: y}"


@dataclass(frozen=True)
class ColumnNames:
    """Names of the columns in the file; those that it lacks are left empty.

    Attributes:
        track: number or name of the road user.
        x, y: position of the centre.
        time: time of the row.
        frame: number of the frame, in place of a time.
        vx, vy: velocity along the axes.
        speed: speed along the heading, in place of a velocity.
        ax, ay: acceleration along the axes.
        heading: direction of the vehicle's front, counter-clockwise from x in the table's axes.
        length, width: size of the vehicle.
        agent_class: name or number of the class.
        recording: name of the recording, where a file has several.
    """

    track: str = ""
    x: str = ""
    y: str = ""
    time: str = ""
    frame: str = ""
    vx: str = ""
    vy: str = ""
    speed: str = ""
    ax: str = ""
    ay: str = ""
    heading: str = ""
    length: str = ""
    width: str = ""
    agent_class: str = ""
    recording: str = ""

    def given(self) -> dict[str, str]:
        """Return the column of the file by its meaning, for those that are given."""
        pairs = ((item.name, getattr(self, item.name)) for item in fields(self))
        return {name: column for name, column in pairs if column}


@dataclass(frozen=True)
class TableColumns:
    """The columns of a table and what their values mean.

    Attributes:
        columns: their names.
        names: the names of all columns in order, where the file has no header line.
        frame_rate: frames per second (Hz), needed with ``frame``.
        unit: unit of positions and sizes.
        time_unit: unit of times.
        speed_unit: unit of velocities and speeds; accelerations are in it per second.
        heading_unit: unit of headings.
        y_axis: direction of y as seen from above, with x to the right: ``down`` for images.
        agent_class: class of all road users, where no column says it.
        location: the site.
        separator: between two cells of a CSV file; a blank stands for any number of blanks.
        decimal: the decimal mark.
        thousands: the mark between groups of digits, empty for none.
    """

    columns: ColumnNames = field(default_factory=ColumnNames)
    names: tuple[str, ...] = ()
    frame_rate: float | None = option(None, above=0.0, high=100_000.0)
    unit: str = option("m", choices=tuple(LENGTHS_M))
    time_unit: str = option("s", choices=tuple(TIMES_S))
    speed_unit: str = option("m/s", choices=tuple(SPEEDS_MPS))
    heading_unit: str = option("rad", choices=("rad", "deg"))
    y_axis: str = option("up", choices=("up", "down"))
    agent_class: str = option("unknown", choices=tuple(c.name.lower() for c in AgentClass))
    location: str = ""
    separator: str = ","
    decimal: str = option(".", choices=(".", ","))
    thousands: str = ""

    def __post_init__(self) -> None:
        check_options(self)
        given = self.columns.given()
        for name in ("track", "x", "y"):
            require(f"columns.{name}", getattr(self.columns, name), name in given, "a column")
        if ("time" in given) == ("frame" in given):
            raise ConfigurationError(
                "columns names " + ("both" if "time" in given else "neither") + " of time and "
                "frame, expected one of them"
            )
        if "frame" in given and self.frame_rate is None:
            raise ConfigurationError(
                "frame_rate is missing, expected frames per second (Hz) beside columns.frame"
            )
        for one, other in (("vx", "vy"), ("ax", "ay"), ("length", "width")):
            if (one in given) != (other in given):
                missing = other if one in given else one
                raise ConfigurationError(
                    f"columns.{missing} is missing, expected it beside "
                    f"columns.{one if one in given else other}"
                )
        if "speed" in given and ("vx" in given or "heading" not in given):
            raise ConfigurationError(
                "columns.speed is given "
                + ("beside columns.vx" if "vx" in given else "without columns.heading")
                + ", expected vx and vy, or speed and heading"
            )
        for name, least in (("separator", 1), ("thousands", 0)):
            value = getattr(self, name)
            require(
                name,
                value,
                least <= len(value) <= 1 and value != self.decimal,
                "one character that differs from the decimal mark",
            )
            # A mark that numbers have would be taken out of them.
            require(
                name,
                value,
                not value or not (value.isalnum() or value in _NO_MARKS),
                "a mark that is no letter, digit, sign, quote or line break",
            )
        require("separator", self.separator, self.separator.isascii(), "a character of ASCII")
        for name in self.names:
            if self.names.count(name) > 1:
                raise ConfigurationError(f"names has {name!r} more than once, expected it once")
        taken: dict[str, str] = {}
        for name, column in given.items():
            if column in taken:
                raise ConfigurationError(
                    f"columns.{name} is {column!r}, which is columns.{taken[column]} already"
                )
            taken[column] = name

    @cached_property
    def form(self) -> CsvForm:
        """How a CSV file writes its cells."""
        return CsvForm(
            separator=self.separator,
            decimal=self.decimal,
            thousands=self.thousands or None,
            names=self.names or None,
        )


def read_columns(path: Path) -> TableColumns:
    """Return the description of a table's columns in a YAML file.

    Raises:
        ConfigurationError: the file cannot be read, or a field is unknown, missing or not allowed.
    """
    data = read_yaml(path, "a description of columns")
    if not isinstance(data, dict) or not isinstance(data.get("columns"), dict):
        raise ConfigurationError(
            f"{path} has no mapping 'columns', expected for example {EXAMPLE}"
        )
    columns, names = _as_written(path)
    if "class" in columns:
        columns["agent_class"] = columns.pop("class")
    data = {str(key): value for key, value in data.items()} | {"columns": columns}
    if isinstance(data.get("names"), list):
        data["names"] = names
    if "class" in data:
        data["agent_class"] = data.pop("class")
    try:
        return from_dict(TableColumns, data, str(path))
    except ConfigurationError as error:
        text = str(error)
        raise ConfigurationError(
            text if text.startswith(str(path)) else f"{path}: {text}"
        ) from error


def _as_written(path: Path) -> tuple[dict[str, str], list[str]]:
    """Return the columns by their meaning, and the names of all: words and not values.

    A column may be called ``no``, ``on`` or ``01``, which YAML takes for a truth value and 1.

    Raises:
        ConfigurationError: a column is no single name.
    """
    columns: dict[str, str] = {}
    names: list[str] = []
    for key, node in read_yaml(path, "a description of columns", as_node=True).value:
        if key.value == "columns":
            for meaning, column in node.value:
                where = f"{path}, line {meaning.start_mark.line + 1}: columns.{meaning.value}"
                if column.id != "scalar":
                    raise ConfigurationError(f"{where} is a list or mapping, expected one column")
                empty = column.tag.endswith(":null")
                columns[str(meaning.value)] = "" if empty else column_name(column.value)
        elif key.value == "names" and node.id == "sequence":
            names = [column_name(name.value) for name in node.value]
    return columns, names
