# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted occupancy as nav_msgs/OccupancyGrid: percent, -1 where it is not known."""

from __future__ import annotations

from typing import Any

import numpy as np

from msg_adapters.conversions import make_header, make_pose, make_time
from msg_adapters.types import Types
from mtpgo_core.risk.predicted_occupancy import OccupancyField

OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"
_UNKNOWN = -1


def field_to_grid(field: OccupancyField, types: Types, *, stamp_ns: int, frame_id: str) -> Any:
    """Return an OccupancyGrid.

    Args:
        field: what to publish.
        types: source of message classes.
        stamp_ns: header stamp (ns).
        frame_id: frame of the grid.
    """
    rows, columns = field.probability.shape
    known = np.isfinite(field.probability)
    percent = np.rint(100.0 * np.where(known, field.probability, 0.0))
    info = types.make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=make_time(types, stamp_ns),
        resolution=float(field.resolution),
        width=columns,
        height=rows,
        origin=make_pose(types, field.corner, 0.0, 0.0),
    )
    return types.make(
        OCCUPANCY_GRID,
        header=make_header(types, stamp_ns, frame_id),
        info=info,
        data=types.small_integers(np.where(known, percent, _UNKNOWN).astype(np.int8)),
    )
