# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``--data DIR --layout LAYOUT --recordings NAME ...`` on a command line, as often as wanted.

One ``--layout`` holds for all directories, and as many as directories belong to them in order. Of
another number, each belongs to the ``--data`` before it (or to the first one), and a directory
without a layout has that of the one before. ``--recordings``, ``--lane-file`` with its options,
and those of bags (``--topic``, ``--stamps`` and others), belong to the ``--data`` before them, or
to the first one. So do ``--columns`` and ``--class-map``, which also hold for the directories
after it. A command may take directory, or layout and directory, without an option.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msg_adapters.conversions import TWIST_FRAMES
from msg_adapters.inputs.ego_odometry import EGO_CLASSES, EgoOptions
from mtpgo_core.class_map import PRESETS
from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file_options import PROJECTIONS, LaneFileOptions
from mtpgo_training.commands.arguments.argument_types import make_folder
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers.bags.bag_options import STAMPS, BagOptions
from mtpgo_training.data.readers.reading_layouts import LAYOUTS
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.recording_cache import RecordingCache, default_folder

_OF_BAGS = ("topics", "stamps", "twist_frame", "ego_topic", "ego_box", "ego_class")
"""Options of bags that are given one by one."""


class _Note(argparse.Action):
    """Appends the option and its value to ``data_options``, for their order matters."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        if values is not None:  # of a directory without an option that is left out
            namespace.data_options = [*namespace.data_options, (self.dest, values)]


def add_data_arguments(
    parser: argparse.ArgumentParser,
    form: str = "--data",
    *,
    required: bool = False,
    topic_help: str = "topic of the tracked objects in the bags of this directory (default: "
    "/objects, else the first of a known type)",
) -> None:
    """Add the arguments for recordings; their values are collected in ``data_options``.

    Args:
        parser: the command's.
        form: ``--data`` for options alone, ``[DIR]`` for a directory without an option (that may
            be left out) besides them, ``LAYOUT DIRECTORY`` for both without options,
            ``BAG|TOPIC`` for a bag, directory or topic without an option.
        required: a directory must be given.
        topic_help: help of ``--topic``.
    """
    parser.set_defaults(data_options=[])
    layouts = ", ".join(LAYOUTS)

    def add(name: str, **settings: Any) -> argparse.Action:
        return parser.add_argument(name, action=_Note, **settings)

    if form == "LAYOUT DIRECTORY":
        completed_by(add("layout", help=f"layout of the recordings: {layouts}"), lambda: LAYOUTS)
        add("data", type=Path, metavar="directory", help="directory with the recordings")
    elif form == "BAG|TOPIC":
        add("data", type=Path, metavar=form, help="bag, directory of recordings, or live topic")
        add("--layout", help=f"layout of recordings that are no bags: {layouts}")
    else:
        if form == "[DIR]":
            add("data", nargs="?", type=Path, metavar="DIR", help="directory with recordings")
        add(
            "--data",
            type=Path,
            metavar="DIR",
            required=required,
            help="directory with recordings; repeatable",
        )
        text = f"layout of each --data, or one for all: {layouts}"
        completed_by(add("--layout", help=text), lambda: LAYOUTS)
    add(
        "--recordings",
        nargs="+",
        metavar="NAME",
        help="names of the recordings wanted of this directory (default: all)",
    )
    add(
        "--columns",
        type=Path,
        metavar="FILE",
        help="YAML file that describes the columns of plain tables (layout table)",
    )
    add(
        "--class-map",
        metavar="NAME",
        help="classes by the names or numbers of the data: a YAML file or one of "
        f"{', '.join(PRESETS)}",
    )
    add("--topic", metavar="TOPIC", help=topic_help)
    add(
        "--topics",
        nargs="+",
        metavar="BAG=TOPIC",
        help="topic of the tracked objects in single bags of this directory",
    )
    add(
        "--lane-file",
        type=Path,
        metavar="FILE",
        help="lanes of this directory's recordings, in place of their own: a Lanelet2 map (OSM) "
        "or GeoJSON",
    )
    add(
        "--lane-projection",
        choices=PROJECTIONS,
        help="how its coordinates become metres: those in the file (auto), or of latitude and "
        "longitude",
    )
    add("--lane-origin", metavar="LAT,LON", help="origin of the metres (degrees)")
    add("--lane-offset", metavar="X,Y", help="subtracted from the metres (m)")
    add(
        "--stamps",
        choices=STAMPS,
        help="leave out messages without a stamp (header), or give them the time at which they "
        "were recorded (log)",
    )
    add(
        "--twist-frame",
        choices=TWIST_FRAMES,
        help="frame of the velocities in the messages of the bags, as the node's parameter of "
        "that name (default)",
    )
    add(
        "--ego-topic",
        metavar="TOPIC",
        help="topic with the ego's odometry in the bags, which makes it a road user",
    )
    add(
        "--ego-box",
        nargs="+",
        type=float,
        metavar="M",
        help="with --ego-topic: length and width of the ego, and how far its centre is ahead of "
        "the odometry's frame (default: 4.5 1.8 0)",
    )
    add("--ego-class", choices=EGO_CLASSES, help="with --ego-topic: class of the ego (car)")


def data_sources(
    options: Sequence[tuple[str, Any]], default: DataSource | None = None
) -> list[DataSource]:
    """Return the directories that a command line names.

    Args:
        options: ``data_options`` of :func:`add_data_arguments`.
        default: the directory where none is given, and its layout where none is given.

    Raises:
        ConfigurationError: a layout is missing or given too often, layout or recordings are
            given without a directory, or a class map is unknown.
    """
    given = [value for name, value in options if name == "layout"]
    entries: list[dict[str, Any]] = []
    first: dict[str, Any] = {}
    for name, value in options:
        if name == "data":
            entries.append({"data": value} | ({} if entries else first))
        else:
            (entries[-1] if entries else first)[name] = value
    if not entries and default is not None:
        if any(layout != default.layout for layout in given):
            raise ConfigurationError(
                f"--layout {given[0]} is given without a directory of recordings"
            )
        entries = [{"data": default.directory, "layout": default.layout} | first]
    if first and not entries:
        option = next(iter(first)).replace("_", "-")
        raise ConfigurationError(f"--{option} is given without --data")
    if len(given) > len(entries):
        raise ConfigurationError(
            f"--layout is given {len(given)} times for {len(entries)} times --data, "
            "expected once or as often"
        )
    if given and len(given) in (1, len(entries)):
        for entry, layout in zip(entries, given * len(entries), strict=False):
            entry["layout"] = layout
    sources: list[DataSource] = []
    for entry in entries:
        layout = entry.get("layout") or (sources[-1].layout if sources else None)
        if layout is None:
            raise ConfigurationError(
                f"the layout of {entry['data']} is not given, expected --layout with one of "
                f"{', '.join(LAYOUTS)}"
            )
        names = entry.get("recordings")
        before = sources[-1].options if sources else AS_USUAL
        reading = ReadingOptions(
            columns=entry.get("columns", before.columns),
            class_map=entry.get("class_map", before.class_map),
            bags=_bag_options(entry),
            **_lane_options(entry),
        )
        # An unknown class map and a lane file that cannot be used are found before all else.
        _ = reading.classes, reading.lanes
        sources.append(DataSource(entry["data"], layout, tuple(names) if names else None, reading))
    for number, entry in enumerate(entries):
        layouts = [source.layout for source in sources[number:]]  # it holds for those after, too
        if "columns" in entry and "table" not in layouts:
            raise ConfigurationError(
                f"--columns is given for the layout {layouts[0]!r}, expected 'table'"
            )
    return sources


def bag_options(options: Sequence[tuple[str, Any]]) -> ReadingOptions:
    """Return how bags that are no directories of recordings are read, by the same options.

    Args:
        options: ``data_options`` of :func:`add_data_arguments` without a directory.

    Raises:
        ConfigurationError: an option of recordings, or a value that is none.
    """
    for name, _ in options:
        known = name in _OF_BAGS
        if not known and not name.startswith("lane_"):
            raise ConfigurationError(f"--{name.replace('_', '-')} is given without --data")
    entry = dict(options)
    return ReadingOptions(bags=_bag_options(entry), **_lane_options(entry))


def _lane_options(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of :class:`ReadingOptions` for a lane file."""
    names = ("projection", "origin", "offset")
    given = {name: entry[f"lane_{name}"] for name in names if f"lane_{name}" in entry}
    if "lane_file" in entry:
        return {"lane_file": entry["lane_file"], "lane_options": LaneFileOptions(**given)}
    if given:
        raise ConfigurationError(f"--lane-{next(iter(given))} is given without --lane-file")
    return {}


def _bag_options(entry: Mapping[str, Any]) -> BagOptions:
    topics: dict[str, str] = {}
    for text in entry.get("topics", ()):
        bag, equals, topic = text.partition("=")
        if not (bag and equals and topic):
            raise ConfigurationError(f"--topics has {text!r}, expected BAG=TOPIC")
        topics[bag] = topic
    return BagOptions(
        topic=entry.get("topic", ""),
        topics=topics,
        stamps=entry.get("stamps", STAMPS[0]),
        twist_frame=entry.get("twist_frame", TWIST_FRAMES[0]),
        ego_topic=entry.get("ego_topic", ""),
        ego=_ego_options(entry),
    )


def _ego_options(entry: Mapping[str, Any]) -> EgoOptions:
    for name in ("ego_box", "ego_class"):
        if name in entry and not entry.get("ego_topic"):
            raise ConfigurationError(
                f"--{name.replace('_', '-')} is given without --ego-topic, which names the ego's"
                " odometry"
            )
    values = dict(zip(("length_m", "width_m", "offset_m"), entry.get("ego_box", ()), strict=False))
    if len(entry.get("ego_box", (1, 1))) not in (2, 3):
        raise ConfigurationError(
            f"--ego-box has {len(entry['ego_box'])} numbers, expected length, width and, if it is"
            " not 0, how far the centre is ahead (m)"
        )
    return EgoOptions(**values, class_name=entry.get("ego_class", EgoOptions.class_name))


def add_cache_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--cache DIR`` and ``--no-cache`` to a command."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="folder of the cache of recordings (default: $XDG_CACHE_HOME/mtpgo)",
    )
    group.add_argument(
        "--no-cache", action="store_true", help="read the files of the recordings every time"
    )


def cache_from(args: argparse.Namespace) -> RecordingCache | None:
    """Return the cache that the command line asks for, None with ``--no-cache``.

    Raises:
        ConfigurationError: the folder named with ``--cache`` cannot be made.
    """
    if args.no_cache:
        return None
    if args.cache is None:
        return RecordingCache(default_folder())
    make_folder("--cache", args.cache)
    return RecordingCache(args.cache)
