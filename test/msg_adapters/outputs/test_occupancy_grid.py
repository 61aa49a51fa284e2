# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The occupancy as a message."""

import numpy as np

from msg_adapters.outputs.occupancy_grid import OCCUPANCY_GRID, field_to_grid
from mtpgo_core.risk.predicted_occupancy import OccupancyField


def test_percent_by_rows_and_minus_one_where_unknown(offline, decoded):
    probability = np.array([[0.0, 0.004, 0.25], [1.0, np.nan, 0.999]])
    field = OccupancyField(np.array([-3.0, 2.0]), 0.5, probability)
    message = field_to_grid(field, offline, stamp_ns=5_000_000_001, frame_id="map")
    for found in decoded(message, OCCUPANCY_GRID, with_rclpy=True).values():
        assert list(found.data) == [0, 0, 25, 100, -1, 100]
        assert (found.info.width, found.info.height) == (3, 2)
        assert found.info.resolution == 0.5
        assert (found.info.origin.position.x, found.info.origin.position.y) == (-3.0, 2.0)
        assert found.info.origin.orientation.w == 1.0
        assert (found.header.stamp.sec, found.header.stamp.nanosec) == (5, 1)
        assert found.header.frame_id == "map"


def test_an_rclpy_message_passes_its_own_checks(online):
    field = OccupancyField(np.zeros(2), 0.5, np.full((4, 4), np.nan))
    message = field_to_grid(field, online, stamp_ns=0, frame_id="map")
    assert set(message.data) == {-1}
