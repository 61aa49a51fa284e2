# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small lane files, written by the tests that read them."""

from __future__ import annotations

import json
from pathlib import Path

NODES = {
    1: (0.0, 3.5),
    2: (50.0, 3.5),
    3: (100.0, 3.5),
    4: (0.0, 0.0),
    5: (50.0, 0.0),
    6: (100.0, 0.0),
    7: (0.0, -3.5),
    8: (100.0, -3.5),
}
"""Number -> x and y (m): three lines along x, 3.5 m apart."""

WAYS = {11: (1, 2, 3), 12: (4, 5, 6), 13: (8, 7)}
"""The upper, middle and lower line; the lower one runs the other way."""

LANELETS = {21: (12, 11), 22: (12, 13)}
"""Westbound above the middle, eastbound below: both have the middle line on their left."""


def osm(
    path: Path,
    *,
    nodes=NODES,
    ways=WAYS,
    lanelets=LANELETS,
    local=True,
    degrees=None,
    tags=None,
    extra="",
) -> Path:
    """Write a Lanelet2 map.

    Args:
        path: the file.
        nodes: number -> x and y (m).
        ways: number -> nodes.
        lanelets: number -> left and right way.
        local: with local_x and local_y.
        degrees: function from x and y to latitude and longitude.
        tags: lanelet -> tags besides the type.
        extra: elements at the end.
    """
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6" generator="test">']
    for number, (x, y) in nodes.items():
        lat, lon = degrees(x, y) if degrees else ("", "")
        inner = f'<tag k="local_x" v="{x}"/><tag k="local_y" v="{y}"/>' if local else ""
        lines.append(f'<node id="{number}" lat="{lat}" lon="{lon}">{inner}</node>')
    for number, members in ways.items():
        inner = "".join(f'<nd ref="{member}"/>' for member in members)
        inner += '<tag k="type" v="line_thin"/><tag k="subtype" v="solid"/>'
        lines.append(f'<way id="{number}">{inner}</way>')
    for number, (left, right) in lanelets.items():
        inner = "".join(
            f'<member type="way" ref="{way}" role="{role}"/>'
            for role, side in (("left", left), ("right", right))
            for way in (side if isinstance(side, tuple) else (side,))
        )
        own = {"type": "lanelet", "subtype": "road", **(tags or {}).get(number, {})}
        inner += "".join(f'<tag k="{key}" v="{value}"/>' for key, value in own.items())
        lines.append(f'<relation id="{number}">{inner}</relation>')
    path.write_text("\n".join([*lines, extra, "</osm>"]))
    return path


def feature(geometry: str, coordinates, **properties) -> dict:
    """Return a feature of a GeoJSON file."""
    shape = {"type": geometry, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": shape}


def geojson(path: Path, *features, **members) -> Path:
    """Write a GeoJSON file with a collection of features."""
    collection = {"type": "FeatureCollection", "features": list(features), **members}
    path.write_text(json.dumps(collection))
    return path
