# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Latitude and longitude to metres, as the usual projections of lane maps do it.

PROJ computes (package pyproj, extra ``maps``). The choices are those of the map loaders in use:
``utm`` is Lanelet2's UtmProjector, ``cartesian`` its LocalCartesianProjector, ``mgrs`` and
``transverse_mercator`` are Autoware's; heights are taken as 0.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file_options import (
    CARTESIAN,
    MGRS,
    TRANSVERSE_MERCATOR,
    LaneFileOptions,
)
from mtpgo_core.schema import Float64Array

_SQUARE_M = 100_000.0
"""Edge of a square of the military grid reference system (m)."""

_UTM_SCALE = 0.9996
"""Scale on the central meridian of UTM, and of Autoware's transverse Mercator projection."""

_FARTHEST_DEG = 20.0
"""Farthest longitude from the central meridian that is projected (degrees); chosen: PROJ's series
is exact to far less than a millimetre there, and no lane map is 2000 km wide."""


def to_metres(path: Path, degrees: Float64Array, options: LaneFileOptions) -> Float64Array:
    """Return [n, 2] x (east) and y (north) of latitudes and longitudes (m).

    Args:
        path: the file, for errors.
        degrees: [n, 2] latitude and longitude (WGS84), n >= 1.
        options: projection and origin; the projection is not one of metres.

    Raises:
        ConfigurationError: pyproj is not installed, or the points do not fit the projection.
    """
    origin = options.origin_deg
    centre = origin or (float(np.median(degrees[:, 0])), float(np.median(degrees[:, 1])))
    if options.projection == CARTESIAN:
        return _project(path, _topocentric(centre), degrees)
    if options.projection == TRANSVERSE_MERCATOR:
        meridian, south = centre[1], False
    else:
        zone = utm_zone(*centre)
        meridian, south = 6.0 * zone - 183.0, centre[0] < 0.0
    away = np.abs((degrees[:, 1] - meridian + 180.0) % 360.0 - 180.0)
    if away.max() > _FARTHEST_DEG:
        far = degrees[int(np.argmax(away))]
        raise ConfigurationError(
            f"{path} has a point at latitude {far[0]:.6f}, longitude {far[1]:.6f}, expected points"
            f" within {_FARTHEST_DEG:g} degrees of longitude {meridian:g}, around"
            f" {'lane_origin' if origin else 'the middle of the file'}"
        )
    pipeline = (
        f"+proj=tmerc +lat_0=0 +lon_0={meridian!r} +k={_UTM_SCALE} +ellps=WGS84"
        f" +x_0={0.0 if options.projection == TRANSVERSE_MERCATOR else 500_000.0}"
        f" +y_0={10_000_000.0 if south else 0.0}"
    )
    found = _project(path, pipeline, degrees)
    if options.projection == MGRS:
        return found - _square(path, found, pipeline, origin)
    if origin is not None:
        found = found - _project(path, pipeline, np.array([origin]))
    return found


def utm_zone(latitude: float, longitude: float) -> int:
    """Return the number of the UTM zone of a place (degrees), with Norway's and Svalbard's."""
    longitude = (longitude + 180.0) % 360.0 - 180.0
    zone = min(60, 1 + math.floor((longitude + 180.0) / 6.0))
    if 56.0 <= latitude < 64.0 and 3.0 <= longitude < 12.0:
        return 32
    if 72.0 <= latitude < 84.0 and 0.0 <= longitude < 42.0:
        return 31 + 2 * math.floor((longitude + 3.0) / 12.0)
    return zone


def crs_of(path: Path, name: str) -> Any:
    """Return the coordinate reference system that a file names.

    Raises:
        ConfigurationError: pyproj is not installed, or PROJ does not know it.
    """
    pyproj = _pyproj(path, f"the coordinate reference system {name!r}")
    try:
        return pyproj.CRS.from_user_input(name)
    except pyproj.exceptions.CRSError as error:
        raise ConfigurationError(
            f"{path} names the coordinate reference system {name!r}, which is unknown: expected"
            " one of EPSG or OGC, such as 'urn:ogc:def:crs:EPSG::25832'"
        ) from error


def degrees_of(path: Path, points: Float64Array, crs: Any) -> Float64Array:
    """Return [n, 2] latitude and longitude (WGS84, degrees) of points in a reference system.

    Args:
        path: the file, for errors.
        points: [n, 2] x and y in the order of GeoJSON: east (or longitude) first.
        crs: of :func:`crs_of`.

    Raises:
        ConfigurationError: a point is outside of the area of use of the system.
    """
    pyproj = _pyproj(path, "the coordinates")
    change = pyproj.Transformer.from_crs(crs, "OGC:CRS84", always_xy=True)
    east, north = change.transform(points[:, 0], points[:, 1])
    found = np.stack([north, east], axis=1)
    _check(path, found, points, "transformed to WGS84")
    return found


def _topocentric(centre: tuple[float, float]) -> str:
    return (
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84"
        f" +lat_0={centre[0]!r} +lon_0={centre[1]!r} +h_0=0"
    )


def _square(
    path: Path, points: Float64Array, pipeline: str, origin: tuple[float, float] | None
) -> Float64Array:
    """Return [2] the corner of the grid square whose metres are used (m)."""
    if origin is not None:
        place = _project(path, pipeline, np.array([origin]))[0]
        corner: Float64Array = _SQUARE_M * np.floor(place / _SQUARE_M)
        return corner
    corners = np.unique(np.floor(points / _SQUARE_M), axis=0)
    if len(corners) > 1:
        raise ConfigurationError(
            f"{path} lies in {len(corners)} squares of the military grid, expected lane_origin in"
            " the one whose metres are used"
        )
    only: Float64Array = _SQUARE_M * corners[0]
    return only


def _project(path: Path, pipeline: str, degrees: Float64Array) -> Float64Array:
    """Return [n, 2] x and y of [n, 2] latitudes and longitudes (m)."""
    pyproj = _pyproj(path, "latitudes and longitudes")
    change = pyproj.Transformer.from_pipeline(pipeline)
    east, north = degrees[:, 1], degrees[:, 0]
    if "topocentric" in pipeline:  # of heights as well: on the ellipsoid
        x, y, _ = change.transform(east, north, np.zeros(len(degrees)))
    else:
        x, y = change.transform(east, north)
    found = np.stack([x, y], axis=1)
    _check(path, found, degrees[:, ::-1], "projected")
    return found


def _check(path: Path, found: Float64Array, given: Float64Array, what: str) -> None:
    bad = ~np.isfinite(found).all(axis=1)
    if bad.any():
        x, y = given[int(np.argmax(bad))]
        raise ConfigurationError(f"{path} has the point {x:.7g}, {y:.7g}, which cannot be {what}")


def _pyproj(path: Path, what: str) -> Any:
    try:
        import pyproj
    except ModuleNotFoundError:
        raise ConfigurationError(
            f"{path} needs pyproj for {what}: install the extra 'maps'"
            " (pip install 'mtpgo_ros[maps]', or pip install pyproj)"
        ) from None
    return pyproj
