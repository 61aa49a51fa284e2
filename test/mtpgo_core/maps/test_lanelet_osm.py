# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of Lanelet2 maps: directions of bounds, projections, defects with their places."""

import numpy as np
import pytest
from lane_files import LANELETS, NODES, WAYS, osm

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.maps.lane_file_options import LaneFileOptions
from mtpgo_core.scene.lane_map import LaneMap


def lines_of(found):
    return sorted(tuple(map(tuple, line.round(3).tolist())) for line in found.lines)


def test_bounds_run_along_the_lanelets(tmp_path):
    found = read_lane_file(osm(tmp_path / "map.osm"))
    west = ((100.0, 0.0), (50.0, 0.0), (0.0, 0.0))
    assert lines_of(found) == sorted(
        [
            west,  # the middle line, once for either direction
            west[::-1],
            ((100.0, 3.5), (50.0, 3.5), (0.0, 3.5)),
            ((0.0, -3.5), (100.0, -3.5)),
        ]
    )
    assert "2 lanelets" in found.sentence
    assert len(found.sha256) == 64
    road = LaneMap(found.lines)
    right, left = road.positions(np.array([[40.0, -1.75], [40.0, 1.75]]), np.array([0.0, np.pi]))
    np.testing.assert_allclose([right, left], 0.0, atol=1e-9)
    assert np.isnan(road.positions(np.array([[40.0, -1.75]]), np.array([np.pi]))).all()


@pytest.mark.parametrize("turned", [(11,), (12,), (13,), (11, 12, 13)])
def test_the_order_of_nodes_in_a_way_does_not_matter(tmp_path, turned):
    ways = {way: n[::-1] if way in turned else n for way, n in WAYS.items()}
    expected = lines_of(read_lane_file(osm(tmp_path / "one.osm")))
    assert lines_of(read_lane_file(osm(tmp_path / "two.osm", ways=ways))) == expected


def test_ways_that_end_in_each_other_are_one_bound(tmp_path):
    ways = {**WAYS, 11: (1, 2), 14: (3, 2)}
    lanelets = {21: (12, (14, 11)), 22: (12, 13)}
    found = read_lane_file(osm(tmp_path / "map.osm", ways=ways, lanelets=lanelets))
    assert lines_of(found) == lines_of(read_lane_file(osm(tmp_path / "whole.osm")))


def test_a_lanelet_for_both_directions(tmp_path):
    path = osm(tmp_path / "map.osm", lanelets={22: (12, 13)}, tags={22: {"one_way": "no"}})
    road = LaneMap(read_lane_file(path).lines)
    both = road.positions(np.tile([40.0, -1.0], (2, 1)), np.array([0.0, np.pi]))
    np.testing.assert_allclose(both[:, 0], [-both[1, 0], both[1, 0]])


def test_sidewalks_and_deleted_elements_are_left_out(tmp_path):
    path = osm(
        tmp_path / "map.osm",
        tags={21: {"subtype": "crosswalk"}},
        extra='<relation id="30" action="delete"><tag k="type" v="lanelet"/></relation>'
        '<relation id="31"><tag k="type" v="regulatory_element"/></relation>',
    )
    found = read_lane_file(path)
    assert found.left_out == {"of subtype crosswalk": 1}
    assert len(found.lines) == 2


def degrees(x, y):
    """Latitude and longitude that the projection cartesian around 49, 8 puts near x and y."""
    return 49.0 + y / 111_219.0, 8.0 + x / 73_171.0


@pytest.mark.parametrize("projection", ["utm", "transverse_mercator", "cartesian"])
def test_latitudes_and_longitudes_around_an_origin(tmp_path, projection):
    pytest.importorskip("pyproj")
    path = osm(tmp_path / "map.osm", local=False, degrees=degrees)
    found = read_lane_file(path, LaneFileOptions(projection, origin="49, 8"))
    points = np.concatenate(found.lines)
    # UTM is turned by the convergence (0.75 degrees) and 0.9996 as large.
    for x, y in NODES.values():
        away = np.hypot(*(points - (x, y)).T).min()
        assert away < (1.4 if projection == "utm" else 0.05)


def test_nodes_without_local_coordinates_need_a_projection(tmp_path):
    path = osm(tmp_path / "map.osm", local=False, degrees=degrees)
    with pytest.raises(ConfigurationError, match=r"expected lane_projection .utm"):
        read_lane_file(path)
    with pytest.raises(ConfigurationError, match=r"line 3: .* without local_x and local_y"):
        read_lane_file(path, LaneFileOptions("local"))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"lanelets": {**LANELETS, 23: (12, 99)}}, r"lanelet 23: its right bound is way 99"),
        ({"ways": {**WAYS, 13: (8, 77)}}, r"line 13: way 13 has node 77, which is not in"),
        ({"ways": {**WAYS, 13: (8,)}}, r"way 13 has 1 nodes, expected at least 2"),
        (
            {"lanelets": {21: (12, ())}},
            r"line 14, lanelet 21: it has no way with the role 'right'",
        ),
        ({"lanelets": {21: (12, (11, 13))}}, r"the ways 11, 13 of its right bound do not join"),
        ({"lanelets": {}}, r"no lanelet \(8 nodes, 3 ways, 0 relations\)"),
        ({"nodes": {**NODES, 2: ("a", 0)}}, r"line 4: local_x='a', expected a number"),
        ({"nodes": {**NODES, 2: (9e7, 0)}}, r"9e\+04 km apart, expected at most 20 km"),
        ({"nodes": {**NODES, 2: (9e9, 0)}}, r"a point is not finite, or beyond 1e\+08 m"),
        ({"extra": '<node id="1" lat="" lon=""/>'}, r"line 16: node 1 is in the file twice"),
        ({"extra": '<node id="9" lat="95" lon="8"/>'}, r"line 16: lat=95 lon=8, expected degrees"),
        ({"extra": '<way id="1.5"/>'}, r"line 16: id='1.5', expected the number"),
        ({"extra": "<way"}, r"line 17, column 1: no XML: "),
        ({"tags": {21: {"subtype": "stairs"}, 22: {"subtype": "walkway"}}}, r"that vehicles use"),
    ],
)
def test_a_defect_is_named_with_its_place(tmp_path, change, sentence):
    path = osm(tmp_path / "map.osm", **change)
    with pytest.raises(ConfigurationError, match=sentence) as raised:
        read_lane_file(path)
    assert str(path) in str(raised.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<OpenDRIVE/>", "is OpenDRIVE, expected a Lanelet2 map"),
        ("<html/>", "XML with the root <html>"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm/>', "line 1: a document type declaration"),
    ],
)
def test_other_xml_is_named(tmp_path, text, sentence):
    (tmp_path / "map.osm").write_text(text)
    with pytest.raises(ConfigurationError, match=sentence):
        read_lane_file(tmp_path / "map.osm")
