# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads a lane file; its kind is detected from its content."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.geojson_lanes import read_geojson
from mtpgo_core.maps.lane_file_options import AS_IN_FILE, LaneFileOptions
from mtpgo_core.maps.lane_lines import LaneLines
from mtpgo_core.maps.lanelet_osm import read_lanelets
from mtpgo_core.whole_file import read_regular, regular_size, user_path

MOST_BYTES = 128 * 2**20
"""Size of the largest lane file that is read (bytes); chosen: maps of cities have tens of MB."""

_READERS = {b"<": read_lanelets, b"{": read_geojson, b"[": read_geojson}
"""First character -> reader."""


def read_lane_file(path: str | Path, options: LaneFileOptions = AS_IN_FILE) -> LaneLines:
    """Return the lane lines of a Lanelet2 map (OSM XML) or a GeoJSON file.

    Raises:
        ConfigurationError: the file is missing, of another kind, too large, damaged or has no
            lanes; or its coordinates need a projection that is not given.
    """
    path = user_path(path)
    content = _content(path)
    start = content[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    reader = _READERS.get(start)
    if reader is None:
        what = "is empty" if not content else "is neither XML nor JSON"
        raise ConfigurationError(f"{path} {what}, expected a Lanelet2 map (OSM XML) or GeoJSON")
    try:
        found = reader(path, content, options)
    except RecursionError as error:
        raise ConfigurationError(f"{path} is nested too deeply, expected a lane file") from error
    offset = options.offset_m
    return dataclasses.replace(
        found,
        lines=tuple(line - offset for line in found.lines),
        sha256=hashlib.sha256(content).hexdigest(),
    )


def require_lane_file(path: str | Path) -> None:
    """Check that a file can be read and is not too large, without reading it.

    Raises:
        ConfigurationError: it is missing, no file or too large.
    """
    path = user_path(path)
    try:
        size = regular_size(path)
        with path.open("rb"):
            pass
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
    if size > MOST_BYTES:
        raise ConfigurationError(
            f"{path} has {size / 2**20:.0f} MiB, expected at most {MOST_BYTES / 2**20:.0f}: cut"
            " the map to the area of use"
        )


def _content(path: Path) -> bytes:
    require_lane_file(path)
    try:
        return read_regular(path, MOST_BYTES)
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
