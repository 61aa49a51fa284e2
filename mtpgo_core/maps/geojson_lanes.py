# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of GeoJSON files.

A LineString or MultiLineString is a lane line in the direction of travel; a Polygon or
MultiPolygon is an area of the road, whose rings count in both directions. The properties
``direction`` (``forward``, ``backward``, ``both``) and ``type`` of a feature say otherwise: with
``type: centerline`` and ``width`` (m) a line is the middle of a lane, and its two edges are used.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file_options import AUTO, LOCAL, LaneFileOptions
from mtpgo_core.maps.lane_lines import LaneLines, beside, require_fewer, usable_line
from mtpgo_core.maps.map_projection import crs_of, degrees_of, to_metres
from mtpgo_core.options import listed
from mtpgo_core.schema import Float64Array

KIND = "GeoJSON"

LINES = {"LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
"""Geometries with lines -> how deep the lists of positions are."""

DIRECTIONS = ("forward", "backward", "both")

_NO_LINES = ("Point", "MultiPoint")
_CENTRE = ("centerline", "centreline", "center_line", "centre_line")
_OTHER_LINES = ("stop_line", "pedestrian_marking", "traffic_sign", "traffic_light")
"""Types of features that are no line along a lane; the names are Lanelet2's."""

_WIDEST_DEG = 2.0
"""Extent from which on coordinates of a file that names no reference system are metres; chosen:
two degrees are 100 km and more, and the lines of two metres are no road."""

_LEAST_WIDTH_M, _MOST_WIDTH_M = 0.5, 20.0
"""Widths that a lane may have (m); chosen."""


@dataclass(frozen=True)
class _Line:
    place: str
    points: Float64Array
    direction: str
    width_m: float = 0.0


@dataclass
class _Content:
    lines: list[_Line] = field(default_factory=list)
    features: int = 0
    left_out: Counter[str] = field(default_factory=Counter)


def read_geojson(path: Path, content: bytes, options: LaneFileOptions) -> LaneLines:
    """Return the lane lines of a GeoJSON file.

    Args:
        path: the file, for errors.
        content: what is in it.
        options: projection and origin.

    Raises:
        ConfigurationError: a defect of the file; the sentence names the feature.
    """
    document = _document(path, content)
    found = _Content()
    for place, feature in _features(path, document):
        found.features += 1
        _take(path, place, feature, found)
    if not found.lines:
        rest = ", ".join(f"{number} {what}" for what, number in found.left_out.items())
        raise ConfigurationError(
            f"{path} has no lane line in {found.features} features{f' ({rest})' if rest else ''},"
            " expected LineString, MultiLineString or Polygon"
        )
    require_fewer(sum(len(line.points) for line in found.lines), path)
    ends = np.cumsum([len(line.points) for line in found.lines])
    points = np.concatenate([line.points for line in found.lines])
    metres = np.split(_metres(path, points, document.get("crs"), options), ends[:-1])
    lines: list[Float64Array] = []
    for item, placed in zip(found.lines, metres, strict=True):
        line = usable_line(placed, path, item.place)
        if line is None:
            continue
        edges = [line]
        if item.width_m:
            edges = [beside(line, 0.5 * item.width_m), beside(line, -0.5 * item.width_m)]
        if item.direction != "backward":
            lines += edges
        if item.direction != "forward":
            lines += [edge[::-1] for edge in edges]
    if not lines:
        raise ConfigurationError(f"{path} has lines, but none of them has a length")
    what = f"{found.features} features"
    return LaneLines(path, KIND, tuple(lines), what, dict(found.left_out))


def _document(path: Path, content: bytes) -> dict[str, Any]:
    try:
        document = json.loads(content.decode("utf-8-sig"))
    except json.JSONDecodeError as error:
        raise ConfigurationError(
            f"{path}, line {error.lineno}, column {error.colno}: no JSON: {error.msg}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} cannot be read as JSON in UTF-8: {error}") from error
    if not isinstance(document, dict) or "type" not in document:
        what = "an object without type" if isinstance(document, dict) else type(document).__name__
        raise ConfigurationError(f"{path} is JSON ({what}), expected GeoJSON")
    return document


def _features(path: Path, document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place and content of each feature; a bare geometry is one."""
    kind = str(document["type"])
    if kind == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list):
            raise ConfigurationError(f"{path} has features {features!r:.40}, expected a list")
        for number, feature in enumerate(features):
            place = f"features[{number}]"
            if not isinstance(feature, dict) or feature.get("type") != "Feature":
                raise ConfigurationError(f"{path}, {place}: no Feature: {feature!r:.60}")
            yield place, feature
    elif kind == "Feature":
        yield "the feature", document
    elif kind in LINES or kind in _NO_LINES or kind == "GeometryCollection":
        yield "the geometry", {"geometry": document}
    else:
        more = ": TopoJSON is another format" if kind == "Topology" else ""
        raise ConfigurationError(
            f"{path} is JSON of the type {kind!r}, expected GeoJSON (FeatureCollection){more}"
        )


def _take(path: Path, place: str, feature: dict[str, Any], found: _Content) -> None:
    """Add the lines of a feature."""
    properties = feature.get("properties") or {}
    if not isinstance(properties, dict):
        raise ConfigurationError(f"{path}, {place}: properties {properties!r:.40}, no object")
    kind = str(properties.get("type", properties.get("subtype", ""))).lower()
    if kind in _OTHER_LINES:
        found.left_out[kind] += 1
        return
    width_m = 0.0
    if kind in _CENTRE:
        if properties.get("width") is None:
            found.left_out["centre lines without width"] += 1
            return
        width_m = _width(path, place, properties["width"])
    _take_geometry(path, place, feature.get("geometry"), properties, width_m, found)


def _take_geometry(
    path: Path,
    place: str,
    geometry: Any,
    properties: dict[str, Any],
    width_m: float,
    found: _Content,
) -> None:
    if geometry is None:
        found.left_out["features without geometry"] += 1
        return
    kind = str(geometry.get("type")) if isinstance(geometry, dict) else ""
    if kind in _NO_LINES:
        found.left_out["points"] += 1
    elif kind == "GeometryCollection" and isinstance(geometry.get("geometries"), list):
        for number, part in enumerate(geometry["geometries"]):
            inner = f"{place}.geometries[{number}]"
            _take_geometry(path, inner, part, properties, width_m, found)
    elif kind in LINES:
        direction = properties.get("direction", "both" if "Polygon" in kind else "forward")
        if direction not in DIRECTIONS:
            raise ConfigurationError(
                f"{path}, {place}: direction {direction!r}, expected one of {listed(DIRECTIONS)}"
            )
        for where, positions in _positions(geometry.get("coordinates"), LINES[kind], place):
            points = _points(path, where, positions)
            found.lines.append(_Line(where, points, direction, width_m))
    else:
        raise ConfigurationError(
            f"{path}, {place}: a geometry of type {kind!r}, expected one of {listed(LINES)}"
        )


def _positions(coordinates: Any, depth: int, place: str) -> Iterator[tuple[str, Any]]:
    """Yield the lists of positions within nested lists."""
    if depth == 1 or not isinstance(coordinates, list):
        yield place, coordinates
        return
    for number, part in enumerate(coordinates):
        yield from _positions(part, depth - 1, f"{place}.coordinates[{number}]")


def _points(path: Path, place: str, positions: Any) -> Float64Array:
    """Return [k, 2] the positions of a line, without heights."""
    try:
        pairs = [(position[0], position[1]) for position in positions]
        numbers = not any(isinstance(value, str | bool) for pair in pairs for value in pair)
        points = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        numbers, points = False, np.empty((0, 2))
    if not numbers or len(points) < 2 or not np.isfinite(points).all():
        raise ConfigurationError(
            f"{path}, {place}: coordinates {positions!r:.60}, expected two or more positions of"
            " two numbers"
        )
    return points


def _width(path: Path, place: str, value: Any) -> float:
    try:
        width = float(value)
    except (TypeError, ValueError, OverflowError):
        width = math.nan
    if not _LEAST_WIDTH_M <= width <= _MOST_WIDTH_M:
        raise ConfigurationError(
            f"{path}, {place}: width {value!r}, expected that of a lane: {_LEAST_WIDTH_M:g} to"
            f" {_MOST_WIDTH_M:g} m"
        )
    return width


def _metres(path: Path, points: Float64Array, crs: Any, options: LaneFileOptions) -> Float64Array:
    """Return [n, 2] the points in metres."""
    if options.projection == LOCAL:
        return points
    system = None
    if crs is not None:
        system = crs_of(path, _crs_name(path, crs))
        metric = system.is_projected and all(a.unit_name == "metre" for a in system.axis_info)
        if metric and options.projection == AUTO:
            return points
        if not system.is_geographic and options.projection == AUTO:
            raise ConfigurationError(
                f"{path} is in {system.name}, whose unit is not the metre: expected"
                " lane_projection, and lane_origin where the frame has one"
            )
    elif options.projection == AUTO and (np.ptp(points, axis=0) > _WIDEST_DEG).any():
        return points
    if options.projection == AUTO:
        raise ConfigurationError(
            f"{path} has longitudes and latitudes (or lines within {_WIDEST_DEG:g} m): expected"
            " lane_projection: utm, mgrs, transverse_mercator or cartesian, with lane_origin where"
            " the frame has one, or local for metres"
        )
    if system is not None:
        degrees = degrees_of(path, points, system)
    else:
        degrees = points[:, ::-1]
        wrong = (np.abs(degrees) > (90.0, 180.0)).any(axis=1)
        if wrong.any():
            x, y = points[int(np.argmax(wrong))]
            raise ConfigurationError(
                f"{path} has the position {x:g}, {y:g}, expected longitude and latitude for"
                f" lane_projection {options.projection!r} ('local' for metres)"
            )
    return to_metres(path, degrees, options)


def _crs_name(path: Path, crs: Any) -> str:
    """Return the name in a member ``crs`` (GeoJSON of 2008, as QGIS writes it)."""
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str) or not name:
        raise ConfigurationError(f"{path} has crs {crs!r:.80}, expected one with a name")
    return name
