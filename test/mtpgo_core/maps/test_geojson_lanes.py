# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of GeoJSON files: geometries, directions, reference systems, defects."""

import json

import numpy as np
import pytest
from lane_files import feature, geojson

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.maps.lane_file_options import LaneFileOptions

LINE = [[0.0, 0.0, 110.0], [50.0, 0.0, 110.0], [100.0, 1.0, 110.0]]


def points_of(path, **options):
    return [line.tolist() for line in read_lane_file(path, LaneFileOptions(**options)).lines]


def test_lines_in_metres(tmp_path):
    path = geojson(
        tmp_path / "lanes.json",
        feature("LineString", LINE),
        feature("MultiLineString", [LINE[:2], [[0.0, 4.0], [0.0, 4.0], [9.0, 4.0]]]),
        feature("Point", [1.0, 2.0]),
        feature("LineString", LINE, type="stop_line"),
        feature("LineString", LINE, type="centerline"),
        {"type": "Feature", "properties": None, "geometry": None},
    )
    flat = [point[:2] for point in LINE]
    assert points_of(path) == [flat, flat[:2], [[0.0, 4.0], [9.0, 4.0]]]
    assert points_of(path, offset="10, -1")[1] == [[-10.0, 1.0], [40.0, 1.0]]
    sentence = read_lane_file(path).sentence
    for part in ("3 lane lines with 7 points from 6 features", "1 points", "1 stop_line"):
        assert part in sentence


def test_directions_areas_and_centre_lines(tmp_path):
    straight = [[0.0, 0.0], [10.0, 0.0]]
    ring = [[0.0, 0.0], [30.0, 0.0], [30.0, 6.0], [0.0, 0.0]]
    path = geojson(
        tmp_path / "lanes.geojson",
        feature("LineString", straight, direction="backward"),
        feature("LineString", straight, direction="both"),
        feature("Polygon", [ring]),
        feature("LineString", straight, type="centerline", width=4),
    )
    expected = [straight[::-1], straight, straight[::-1], ring, ring[::-1]]
    expected += [[[0.0, 2.0], [10.0, 2.0]], [[0.0, -2.0], [10.0, -2.0]]]
    assert points_of(path) == expected


def test_a_bare_geometry_and_a_collection_of_geometries(tmp_path):
    path = tmp_path / "one.json"
    inner = {"type": "LineString", "coordinates": LINE}
    path.write_text(json.dumps(inner))
    assert len(points_of(path)) == 1
    path.write_text(json.dumps({"type": "GeometryCollection", "geometries": [inner, inner]}))
    assert len(points_of(path)) == 2


DEGREES = [[8.43, 49.0], [8.431, 49.0]]


def test_longitudes_and_latitudes(tmp_path):
    path = geojson(tmp_path / "lanes.geojson", feature("LineString", DEGREES))
    with pytest.raises(ConfigurationError, match="expected lane_projection"):
        points_of(path)
    pytest.importorskip("pyproj")
    ((start, end),) = points_of(path, projection="cartesian", origin="49.0 8.43")
    np.testing.assert_allclose([start, end], [[0.0, 0.0], [73.17, 0.0]], atol=5e-3)
    metres = geojson(tmp_path / "metres.geojson", feature("LineString", LINE[:2]))
    metres.write_text(metres.read_text().replace("50.0", "500.0"))
    with pytest.raises(ConfigurationError, match="position 500, 0, expected longitude"):
        points_of(metres, projection="utm")


@pytest.mark.parametrize("name", ["urn:ogc:def:crs:EPSG::25832", "EPSG:32632"])
def test_a_named_reference_system(tmp_path, name):
    pytest.importorskip("pyproj")
    line = feature("LineString", [[458_000.0, 5_427_000.0], [458_100.0, 5_427_000.0]])
    crs = {"type": "name", "properties": {"name": name}}
    path = geojson(tmp_path / "lanes.geojson", line, crs=crs)
    assert points_of(path) == [line["geometry"]["coordinates"]]
    ((x, y), _) = points_of(path, projection="mgrs")[0]
    np.testing.assert_allclose([x, y], [58_000.0, 27_000.0], atol=1.0)  # ETRS89 is not WGS84
    crs["properties"]["name"] = "EPSG:99999999"
    with pytest.raises(ConfigurationError, match="EPSG:99999999', which is unknown"):
        points_of(geojson(path, line, crs=crs))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ('{"type": "FeatureCollection"', "line 1, column 29: no JSON"),
        ("[1, 2]", "is JSON .list., expected GeoJSON"),
        ('{"type": "Topology"}', "TopoJSON is another format"),
        ('{"type": "FeatureCollection"}', "has features None, expected a list"),
        ('{"type": "FeatureCollection", "features": []}', "no lane line in 0 features"),
        ('{"type": "FeatureCollection", "features": [3]}', r"features\[0\]: no Feature: 3"),
        ('{"type": "LineString", "coordinates": [[1, 2]]}', "expected two or more positions"),
        ('{"type": "LineString", "coordinates": [[1, 2], ["3", 4]]}', "two or more positions"),
        ('{"type": "LineString", "coordinates": [[1, 2], [NaN, 4]]}', "two or more positions"),
        (f'{{"type": "LineString", "coordinates": [[1, 2], [1{"0" * 400}, 4]]}}', "two or more"),
        ('{"type": "MultiLineString", "coordinates": [[[1, 2], 3]]}', r"coordinates\[0\]: coord"),
        ('{"type": "Feature", "geometry": {"type": "Circle"}}', "geometry of type 'Circle'"),
        ('{"type": "Feature", "geometry": null}', "1 features without geometry"),
    ],
)
def test_a_defect_is_named(tmp_path, content, sentence):
    path = tmp_path / "lanes.geojson"
    path.write_text(content)
    with pytest.raises(ConfigurationError, match=sentence) as raised:
        read_lane_file(path)
    assert str(path) in str(raised.value)


@pytest.mark.parametrize(
    ("properties", "sentence"),
    [
        ({"direction": "north"}, r"features\[0\]: direction 'north', expected one of"),
        ({"type": "centerline", "width": 400}, "width 400, expected that of a lane"),
    ],
)
def test_a_wrong_property_is_named(tmp_path, properties, sentence):
    path = geojson(tmp_path / "lanes.geojson", feature("LineString", LINE, **properties))
    with pytest.raises(ConfigurationError, match=sentence):
        read_lane_file(path)
