# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of Lanelet2 maps (OSM XML).

A lanelet is a relation with a left and a right bound. Both run in its direction of travel; where
the file has one of them the other way round, it is turned, as Lanelet2 does: the left bound has
the right one on its right. A bound that lanelets of both directions share becomes two lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file_options import AUTO, LOCAL, LaneFileOptions
from mtpgo_core.maps.lane_lines import LaneLines, require_fewer, usable_line
from mtpgo_core.maps.map_projection import to_metres
from mtpgo_core.schema import Float64Array

KIND = "Lanelet2 OSM"

WITHOUT_VEHICLES = ("crosswalk", "walkway", "shared_walkway", "stairs", "rail")
"""Subtypes of lanelets that are no lane of a road, so that their bounds are left out."""

_WRONG_ROOTS = {
    "OpenDRIVE": "OpenDRIVE",
    "commonRoad": "CommonRoad",
    "kml": "KML",
    "gpx": "GPX",
    "net": "a network of SUMO",
}
"""Root elements of other maps in XML -> what they are."""


@dataclass
class _Way:
    line: int
    nodes: list[int] = field(default_factory=list)


@dataclass
class _Relation:
    line: int
    id: int
    members: list[tuple[str, str, int]] = field(default_factory=list)
    tags: dict[str, str] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """What an error names."""
        return f"line {self.line}, lanelet {self.id}"

    @property
    def both_ways(self) -> bool:
        """Whether traffic may go in both directions."""
        return self.tags.get("one_way", "yes").lower() in ("no", "false", "0")


class _Elements:
    """The elements of an OSM file, filled by expat."""

    def __init__(self, path: Path) -> None:
        self.node: dict[int, int] = {}
        self.degrees: list[tuple[float, float]] = []
        self.local: list[list[float]] = []
        self.node_line: list[int] = []
        self.ways: dict[int, _Way] = {}
        self.relations: dict[int, _Relation] = {}
        self._path = path
        self._way: _Way | None = None
        self._relation: _Relation | None = None
        self._in_node = self._begun = False
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self, content: bytes) -> None:
        """Read a file.

        Raises:
            ConfigurationError: it is no OSM file, or an element is not as it should be.
        """
        try:
            self._parser.Parse(content, True)
        except expat.ExpatError as error:
            raise ConfigurationError(
                f"{self._path}, line {error.lineno}, column {error.offset + 1}: no XML:"
                f" {expat.ErrorString(error.code)}"
            ) from error
        except (LookupError, ValueError) as error:
            raise ConfigurationError(f"{self._path}, line {self._line}: {error}") from error

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._begun:
            self._begun = True
            if name != "osm":
                what = _WRONG_ROOTS.get(name, f"XML with the root <{name}>")
                raise ConfigurationError(f"{self._path} is {what}, expected a Lanelet2 map (OSM)")
        elif name == "node":
            self._add_node(attributes)
        elif name == "way":
            self._way = _Way(self._line)
            if not _deleted(attributes):
                self._new(self.ways, "way", attributes, self._way)
        elif name == "relation":
            self._relation = _Relation(self._line, 0)
            if not _deleted(attributes):
                self._relation.id = self._new(
                    self.relations, "relation", attributes, self._relation
                )
        elif name == "nd" and self._way is not None:
            self._way.nodes.append(self._integer("ref", attributes))
        elif name == "member" and self._relation is not None:
            item = (attributes.get("type", ""), attributes.get("role", ""))
            self._relation.members.append((*item, self._integer("ref", attributes)))
        elif name == "tag":
            self._add_tag(attributes)

    def _end(self, name: str) -> None:
        if name == "node":
            self._in_node = False
        elif name == "way":
            self._way = None
        elif name == "relation":
            self._relation = None

    def _doctype(self, *_: Any) -> None:
        raise ConfigurationError(
            f"{self._path}, line {self._line}: a document type declaration, which OSM files do"
            " not have"
        )

    @property
    def _line(self) -> int:
        return self._parser.CurrentLineNumber

    def _add_node(self, attributes: dict[str, str]) -> None:
        if _deleted(attributes):
            return
        self._new(self.node, "node", attributes, len(self.degrees))
        nothing = attributes.get("lat", "") == attributes.get("lon", "") == ""
        if nothing:
            place = (np.nan, np.nan)  # maps in local coordinates may leave them empty
        else:
            place = (self._number("lat", attributes), self._number("lon", attributes))
            if not (abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0):
                raise self._error(
                    f"lat={place[0]:g} lon={place[1]:g}, expected degrees: -90 to 90 and -180 to"
                    " 180"
                )
        self.degrees.append(place)
        self.local.append([np.nan, np.nan])
        self.node_line.append(self._line)
        self._in_node = True

    def _add_tag(self, attributes: dict[str, str]) -> None:
        key = attributes.get("k", "")
        if self._in_node and key in ("local_x", "local_y"):
            self.local[-1][key == "local_y"] = self._number("v", attributes, key)
        elif self._relation is not None:
            self._relation.tags[key] = attributes.get("v", "")

    def _new(self, taken: dict[int, Any], what: str, attributes: dict[str, str], item: Any) -> int:
        number = self._integer("id", attributes)
        if number in taken:
            raise self._error(f"{what} {number} is in the file twice")
        taken[number] = item
        return number

    def _integer(self, name: str, attributes: dict[str, str]) -> int:
        try:
            return int(attributes[name])
        except (KeyError, ValueError):
            raise self._error(
                f"{name}={attributes.get(name)!r:.60}, expected the number of an element"
            ) from None

    def _number(self, name: str, attributes: dict[str, str], called: str = "") -> float:
        try:
            value = float(attributes[name])
        except (KeyError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            raise self._error(f"{called or name}={attributes.get(name)!r:.60}, expected a number")
        return value

    def _error(self, what: str) -> ConfigurationError:
        return ConfigurationError(f"{self._path}, line {self._line}: {what}")


@dataclass(frozen=True)
class _Lanelet:
    """A lanelet of the road; its bounds are positions of nodes in the file."""

    relation: _Relation
    left: list[int]
    right: list[int]


def read_lanelets(path: Path, content: bytes, options: LaneFileOptions) -> LaneLines:
    """Return the bounds of the lanelets that vehicles use.

    Args:
        path: the file, for errors.
        content: what is in it.
        options: projection and origin.

    Raises:
        ConfigurationError: a defect of the file; the sentence names the line.
    """
    elements = _Elements(path)
    elements.read(content)
    left_out: Counter[str] = Counter()
    lanelets = []
    for relation in elements.relations.values():
        if relation.tags.get("type") != "lanelet":
            continue
        if relation.tags.get("subtype") in WITHOUT_VEHICLES:
            left_out[f"of subtype {relation.tags['subtype']}"] += 1
            continue
        lanelets.append(
            _Lanelet(
                relation,
                _bound(path, elements, relation, "left"),
                _bound(path, elements, relation, "right"),
            )
        )
    if not lanelets:
        raise ConfigurationError(_nothing(path, elements, left_out))
    used = np.unique(np.concatenate([[*one.left, *one.right] for one in lanelets]))
    metres = np.full((len(elements.degrees), 2), np.nan)
    metres[used] = _metres(path, elements, used, options)
    lines: dict[tuple[int, ...], Float64Array] = {}
    for one in lanelets:
        for nodes in _in_direction(one, metres):
            if nodes not in lines:
                line = usable_line(metres[list(nodes)], path, one.relation.place)
                if line is not None:
                    lines[nodes] = line
    require_fewer(sum(map(len, lines.values())), path)
    if not lines:
        raise ConfigurationError(f"{path} has lanelets, but all of their bounds have no length")
    what = f"{len(lanelets)} lanelets"
    return LaneLines(path, KIND, tuple(lines.values()), what, dict(left_out))


def _bound(path: Path, elements: _Elements, relation: _Relation, side: str) -> list[int]:
    """Return the positions of the nodes of one side; several ways are joined at their ends."""
    refs = [ref for kind, role, ref in relation.members if role == side and kind == "way"]
    if not refs:
        raise ConfigurationError(
            f"{path}, {relation.place}: it has no way with the role {side!r}, expected one"
        )
    pieces = []
    for ref in refs:
        way = elements.ways.get(ref)
        if way is None:
            raise ConfigurationError(
                f"{path}, {relation.place}: its {side} bound is way {ref}, which is not in the"
                " file"
            )
        missing = next((node for node in way.nodes if node not in elements.node), None)
        if missing is not None:
            raise ConfigurationError(
                f"{path}, line {way.line}: way {ref} has node {missing}, which is not in the file"
            )
        if len(way.nodes) < 2:
            raise ConfigurationError(
                f"{path}, line {way.line}: way {ref} has {len(way.nodes)} nodes, expected at least"
                f" 2, as it is the {side} bound of lanelet {relation.id}"
            )
        pieces.append([elements.node[node] for node in way.nodes])
    joined = pieces.pop(0)
    while pieces:
        for number, piece in enumerate(pieces):
            longer = _joined(joined, piece)
            if longer:
                joined = longer
                del pieces[number]
                break
        else:
            raise ConfigurationError(
                f"{path}, {relation.place}: the ways {', '.join(map(str, refs))} of its {side}"
                " bound do not join, expected ways that share end nodes"
            )
    return joined


def _joined(one: list[int], other: list[int]) -> list[int]:
    """Return two lines that share an end joined into one; empty if they share none."""
    for first in (one, one[::-1]):
        for second in (other, other[::-1]):
            if first[-1] == second[0]:
                return [*first, *second[1:]]
    return []


def _metres(
    path: Path, elements: _Elements, used: np.ndarray, options: LaneFileOptions
) -> Float64Array:
    """Return [n, 2] the places of the nodes in use (m)."""
    if options.projection in (AUTO, LOCAL):
        local = np.array(elements.local, dtype=np.float64)[used]
        lacking = ~np.isfinite(local).all(axis=1)
        if not lacking.any():
            return local
        first = used[int(np.argmax(lacking))]
        if options.projection == LOCAL or not lacking.all():
            raise ConfigurationError(
                f"{path}, line {elements.node_line[first]}: a node without local_x and local_y"
                f" ({int(lacking.sum())} of {len(used)} in use), expected both at every node, or a"
                " lane_projection of latitude and longitude"
            )
        raise ConfigurationError(
            f"{path} has latitudes and longitudes and no local_x and local_y: expected"
            " lane_projection (utm, mgrs, transverse_mercator or cartesian), and lane_origin where"
            " the frame has one"
        )
    degrees = np.array(elements.degrees, dtype=np.float64)[used]
    lacking = ~np.isfinite(degrees).all(axis=1)
    if lacking.any():
        first = used[int(np.argmax(lacking))]
        raise ConfigurationError(
            f"{path}, line {elements.node_line[first]}: a node without lat and lon, expected both"
            f" for lane_projection {options.projection!r}"
        )
    return to_metres(path, degrees, options)


def _in_direction(lanelet: _Lanelet, metres: Float64Array) -> list[tuple[int, ...]]:
    """Return the node positions of both bounds in the direction of travel, or in both."""
    left, right = lanelet.left, lanelet.right
    if _is_left_of(metres[left], metres[right]):
        left = left[::-1]
    if not _is_left_of(metres[right], metres[left]):
        right = right[::-1]
    ways = [left, right]
    if lanelet.relation.both_ways:
        ways += [left[::-1], right[::-1]]
    return [tuple(nodes) for nodes in ways]


def _is_left_of(line: Float64Array, other: Float64Array) -> bool:
    """Whether the middle of another line is to the left of a line."""
    middle = other[len(other) // 2] if len(other) > 2 else other.mean(axis=0)
    along = np.diff(line, axis=0)
    to_middle = middle - line[:-1]
    squared = np.maximum((along**2).sum(axis=1), 1e-18)
    share = np.clip((to_middle * along).sum(axis=1) / squared, 0.0, 1.0)
    away = to_middle - share[:, None] * along
    distance = (away**2).sum(axis=1)
    nearest = np.flatnonzero(distance <= distance.min() + 1e-12)
    # At a joint of two segments the sides may differ: the directions count together.
    ahead = (along / np.sqrt(squared)[:, None])[nearest].sum(axis=0)
    at = line[nearest[0]] + share[nearest[0]] * along[nearest[0]]
    return bool(ahead[0] * (middle - at)[1] - ahead[1] * (middle - at)[0] > 0.0)


def _deleted(attributes: dict[str, str]) -> bool:
    """Whether an editor marked an element as deleted."""
    return attributes.get("action") == "delete" or attributes.get("visible") == "false"


def _nothing(path: Path, elements: _Elements, left_out: Counter[str]) -> str:
    """Return why a file has no lane."""
    if left_out:
        some = ", ".join(f"{number} {what}" for what, number in left_out.items())
        return f"{path} has no lanelet that vehicles use: {some}"
    found = _numbers(nodes=elements.node, ways=elements.ways, relations=elements.relations)
    return (
        f"{path} has no lanelet ({found}), expected relations with the tag type=lanelet: a road"
        " map of OpenStreetMap has none"
    )


def _numbers(**groups: Sequence[Any] | dict[int, Any]) -> str:
    return ", ".join(f"{len(group)} {name}" for name, group in groups.items())
