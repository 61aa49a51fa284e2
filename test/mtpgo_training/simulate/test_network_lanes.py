# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane lines of a network: edges of the lanes, through joints, not over junctions."""

import numpy as np

from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_training.simulate.network_lanes import network_lanes

NETWORK = """<net>
  <edge id=":j_0" function="internal">
    <lane id=":j_0_0" width="3.0" shape="50,-1.5 54,-1.5"/></edge>
  <edge id=":x_0" function="internal">
    <lane id=":x_0_0" width="3.0" shape="100,-1.5 110,-1.5"/></edge>
  <edge id="a"><lane id="a_0" allow="pedestrian" width="2.0" shape="0,-5.5 50,-5.5"/>
    <lane id="a_1" width="3.0" shape="0,-3 50,-3"/>
    <lane id="a_2" width="3.0" shape="0,0,7 50,0,7"/></edge>
  <edge id="b"><lane id="b_0" shape="54,-1.5 100,-1.5"/></edge>
  <edge id=":x_w0" function="walkingarea"><lane id=":x_w0_0" shape="0,9 1,9"/></edge>
  <connection from="a" to="b" via=":j_0_0" dir="s"/>
  <connection from="b" to="c" via=":x_0_0" dir="s"/>
  <connection from="d" to="e" via=":x_1_0" dir="s"/>
</net>"""


def test_lines_are_the_edges_of_the_lanes(tmp_path):
    (tmp_path / "road.net.xml").write_text(NETWORK)
    lines = network_lanes(tmp_path / "road.net.xml")
    found = {(line[0, 0], round(line[0, 1], 3)) for line in lines}
    assert found == {
        (50.0, -3.0),  # the joint of a and b
        (50.0, 0.0),
        (0.0, -4.5),  # a: two lanes for vehicles, with three lines
        (0.0, -1.5),
        (0.0, 1.5),
        (54.0, -3.1),  # b: the default width
        (54.0, 0.1),
    }
    place = LaneMap(lines).positions(np.array([[25.0, -3.0], [105.0, -1.5]]), np.zeros(2))
    np.testing.assert_allclose(place[0], [0.0, 0.5], atol=1e-9)
    assert np.isnan(place[1]).all()  # within the junction x
