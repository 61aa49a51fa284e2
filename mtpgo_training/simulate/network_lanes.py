# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of a network of Eclipse SUMO: the edges of its lanes.

Junctions where roads cross have no lines, as most have no markings; where a road goes on, or lanes
join or part, they go through.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from mtpgo_core.maps.lane_lines import beside, usable_line
from mtpgo_core.schema import Float64Array

_WIDTH_M = 3.2
"""Width of a lane whose width the network does not state (m): SUMO's default."""


def network_lanes(path: Path) -> tuple[Float64Array, ...]:
    """Return the lane lines of a network, [k, 2] each (m), along the direction of travel.

    Args:
        path: the file that netconvert wrote.
    """
    root = ElementTree.parse(path).getroot()
    through = _through(root)
    lines: list[Float64Array] = []
    for edge in root.iter("edge"):
        if edge.get("function", "normal") not in ("normal", "internal"):
            continue  # sidewalks over and beside the road
        before: Float64Array | None = None
        for lane in edge.iter("lane"):  # from right to left
            inside = edge.get("function") == "internal" and lane.get("id") not in through
            if lane.get("allow") == "pedestrian" or inside:
                before = None
                continue
            points = [place.split(",")[:2] for place in lane.get("shape", "").split()]
            middle = usable_line(np.array(points, dtype=np.float64), path, lane.get("id", ""))
            if middle is None:
                before = None
                continue
            half = 0.5 * float(lane.get("width", _WIDTH_M))
            right, left = beside(middle, -half), beside(middle, half)
            if before is None or not _same(before, right):
                lines.append(right)
            lines.append(left)
            before = left
    return tuple(lines)


def _through(root: ElementTree.Element) -> set[str]:
    """Return the lanes inside of junctions that are no crossing of roads."""
    links = [(via, link) for link in root.iter("connection") if (via := link.get("via"))]
    into, out = defaultdict[str, set[str]](set), defaultdict[str, set[str]](set)
    for via, link in links:
        into[_junction(via)].add(link.get("from", ""))
        out[_junction(via)].add(link.get("to", ""))
    return {
        via
        for via, link in links
        if link.get("dir") == "s" and min(len(into[_junction(via)]), len(out[_junction(via)])) == 1
    }


def _junction(lane: str) -> str:
    """Return the junction that a lane inside of it belongs to."""
    return lane.rsplit("_", 2)[0]


def _same(one: Float64Array, other: Float64Array) -> bool:
    return one.shape == other.shape and bool(np.abs(one - other).max() < 0.05)
