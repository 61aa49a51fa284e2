# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Projections compared with the values of Lanelet2's own projectors and of known places."""

from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps.lane_file_options import LaneFileOptions
from mtpgo_core.maps.map_projection import to_metres, utm_zone

DEGREES = np.array([[49.005, 8.4321], [49.02, 8.40]])

BY_LANELET2 = {
    "utm": [[157.756368828, 554.671593715], [-2176.68530205, 2240.20103361]],
    "cartesian": [[153.645384246, 556.051056512], [-2194.27464148, 2224.63213994]],
}
"""What lanelet2 1.2.3 (GeographicLib) gives around 49.0, 8.43."""


@pytest.mark.parametrize("projection", BY_LANELET2)
def test_projections_are_those_of_lanelet2(projection):
    pytest.importorskip("pyproj")
    found = to_metres(Path("map"), DEGREES, LaneFileOptions(projection, origin="49.0, 8.43"))
    np.testing.assert_allclose(found, BY_LANELET2[projection], atol=1e-6)


def test_utm_without_an_origin_is_that_of_the_zone_and_mgrs_within_its_square():
    pytest.importorskip("pyproj")
    south = np.array([[-33.8568, 151.2153]])  # the Sydney Opera House, 56H LH 34900 52288
    np.testing.assert_allclose(
        to_metres(Path("map"), south, LaneFileOptions("utm")), [[334_897.0, 6_252_288.0]], atol=5.0
    )
    inside = to_metres(Path("map"), south, LaneFileOptions("mgrs"))
    np.testing.assert_allclose(inside, [[34_897.0, 52_288.0]], atol=5.0)
    apart = np.array([[49.0, 8.43], [49.0, 9.8]])
    with pytest.raises(ConfigurationError, match="2 squares of the military grid"):
        to_metres(Path("map"), apart, LaneFileOptions("mgrs"))
    found = to_metres(Path("map"), apart, LaneFileOptions("mgrs", origin="49.0, 8.43"))
    assert 0 <= found[0, 0] < 1e5 < found[1, 0]


def test_points_far_from_the_origin_are_an_error():
    pytest.importorskip("pyproj")
    with pytest.raises(ConfigurationError, match=r"longitude 8\.4.*around lane_origin"):
        to_metres(Path("map"), DEGREES, LaneFileOptions("utm", origin="35.6, 139.7"))


def test_zones():
    assert utm_zone(49.0, 8.43) == 32
    assert utm_zone(35.6, 139.7) == 54
    assert utm_zone(60.4, 5.3) == 32  # Bergen
    assert utm_zone(78.2, 15.6) == 33  # Longyearbyen
    assert utm_zone(0.0, 180.0) == 1
    assert utm_zone(0.0, 179.999) == 60


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"projection": "mercator"}, "lane_projection is 'mercator', expected one of"),
        ({"origin": "49"}, "lane_origin is '49', expected latitude and longitude"),
        ({"origin": "8.43, 149.0"}, None),
        ({"origin": "149.0, 8.43"}, "-90 to 90"),
        ({"offset": "1, nan"}, "lane_offset is '1, nan', expected x and y"),
        ({"projection": "cartesian"}, "lane_origin is not given for lane_projection 'cartesian'"),
    ],
)
def test_options_are_checked(values, sentence):
    if sentence is None:
        assert LaneFileOptions(**values).origin_deg == (8.43, 149.0)
        return
    with pytest.raises(ConfigurationError, match=sentence):
        LaneFileOptions(**values)
