# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane files: Lanelet2 maps and GeoJSON."""

from __future__ import annotations

import numpy as np
from fuzz_target import FuzzTarget, place

from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.maps.lane_file_options import LaneFileOptions
from mtpgo_core.scene.lane_map import LaneMap

OSM = b"""<osm>
<node id="1" lat="49" lon="8"><tag k="local_x" v="0"/><tag k="local_y" v="2"/></node>
<node id="2" lat="49" lon="8.1"><tag k="local_x" v="9"/><tag k="local_y" v="2"/></node>
<node id="3" lat="49" lon="8"><tag k="local_x" v="0"/><tag k="local_y" v="-2"/></node>
<node id="4" lat="49" lon="8.1"><tag k="local_x" v="9"/><tag k="local_y" v="-2"/></node>
<way id="5"><nd ref="1"/><nd ref="2"/></way><way id="6"><nd ref="4"/><nd ref="3"/></way>
<relation id="7"><member type="way" ref="5" role="left"/><member type="way" ref="6" role="right"/>
<tag k="type" v="lanelet"/><tag k="one_way" v="no"/></relation></osm>"""
GEOJSON = b"""{"type": "FeatureCollection", "features": [
{"type": "Feature", "properties": {"direction": "both"},
"geometry": {"type": "LineString", "coordinates": [[0, 2, 1], [9, 2, 1]]}},
{"type": "Feature", "properties": {"type": "centerline", "width": 3.5},
"geometry": {"type": "MultiLineString", "coordinates": [[[0, 2], [9, 2]]]}}]}"""


def read(data: bytes) -> None:
    """Read a lane file and look a place up."""
    path = place("lanes") / "lanes"
    path.write_bytes(data)
    lines = read_lane_file(path, LaneFileOptions("local")).lines
    found = LaneMap(lines).positions(np.array([[4.0, 1.0]]), np.zeros(1))
    assert not np.isinf(found).any(), "a position that is infinite"


def targets() -> list[FuzzTarget]:
    """Return the targets of this file."""
    return [FuzzTarget("lane_file", read, lambda: [OSM, GEOJSON], text=True)]
