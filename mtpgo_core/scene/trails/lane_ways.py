# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Paths along the lane (``scene.lane_ways``), used where no earlier road user left a trail.

They have the format of a branch of the trails and take its place, so that a network that was
trained with trails needs no further input for lanes.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.trails.trail_branches import alike_limit_m
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import Float32Array, Float64Array

ALONG_RAD = 0.6
"""An agent whose heading differs more from the lane's direction does not follow it (rad); chosen:
who turns into a road does before its end, who crosses it does not."""

GAP_M = 8.0
"""Lines may be missing over this distance (m); chosen: a driveway. Junctions are longer, and their
lanes lead in several directions."""

_MARGIN = 0.15
"""Least distance of a path from a lane line, as a share of the lane's width; chosen: vehicles do
not drive on a line for long."""


def lane_ways(
    lanes: LaneMap, position: Float64Array, heading: Float64Array, distance: Float64Array
) -> tuple[Float64Array, IntArray]:
    """Return paths along the lanes of n agents, and how far they are known.

    A path begins at the agent and keeps its relative lateral position in the lane. Each step goes
    ahead along the lane's direction, then sideways back to that lateral position.

    Args:
        lanes: the lines, in the frame of the agents.
        position: [n, 2] (m).
        heading: [n] (rad), NaN for agents that get no path.
        distance: [n, H] ascending distances ahead (m).

    Returns:
        [n, H, 2] positions in the same frame (m), NaN where unknown, and [n] the number of known
        steps, 0 for agents outside of all lanes.
    """
    n, horizon = distance.shape
    places = np.full((n, horizon, 2), np.nan)
    reach = np.zeros(n, dtype=np.int64)
    begin = lanes.sides(position, heading)
    going = np.flatnonzero(np.abs(begin.turn_rad) <= ALONG_RAD)  # NaN is not
    share = np.clip(begin.left_m / (begin.left_m - begin.right_m), _MARGIN, 1.0 - _MARGIN)
    at, course = position.copy(), heading + begin.turn_rad
    missing_m = np.zeros(n)
    step_m = np.diff(distance, axis=1, prepend=0.0)
    for k in range(horizon):
        if not len(going):
            break
        ahead = np.stack([np.cos(course[going]), np.sin(course[going])], axis=1)
        moved = at[going] + step_m[going, k, None] * ahead
        lane = lanes.sides(moved, course[going])
        inside = np.isfinite(lane.turn_rad)
        aside = lane.left_m - share[going] * (lane.left_m - lane.right_m)
        moved += np.where(inside, aside, 0.0)[:, None] * ahead[:, ::-1] * (-1.0, 1.0)
        at[going] = places[going, k] = moved
        course[going] += np.where(inside, lane.turn_rad, 0.0)
        missing_m[going] = np.where(inside, 0.0, missing_m[going] + step_m[going, k])
        reach[going[inside]] = k + 1
        going = going[missing_m[going] <= GAP_M]
    places[np.arange(horizon) >= reach[:, None]] = np.nan
    return places, reach


def with_lane_ways(
    features: Float32Array, ahead: Float64Array, left: Float64Array, distance: Float64Array
) -> Float32Array:
    """Return trail features that are completed by paths along the lanes.

    An agent without any trail gets the path along its lane as its only branch. If the heaviest
    branch that runs along the lane ends before the lane's path does, it is continued parallel to
    that path.

    Args:
        features: [n, R, H, 3], see
            :func:`mtpgo_core.scene.trails.trail_context.trail_features`.
        ahead: [n, H] x of the lanes' paths in the agents' frames (m), NaN where unknown.
        left: [n, H] y of them (m), NaN where unknown.
        distance: [n, H] distances ahead (m).
    """
    result = features.copy()
    way = np.stack([ahead - distance, left], axis=-1).astype(np.float32)  # [n, H, 2]
    in_lane = np.isfinite(way[..., 0])
    known = features[..., 2] > 0.0  # [n, R, H]
    alone = ~known[:, 0, 0] & in_lane[:, 0]
    result[alone, 0, :, :2] = np.nan_to_num(way[alone])
    result[alone, 0, :, 2] = in_lane[alone]
    apart = np.hypot(*np.moveaxis(features[..., :2] - way[:, None], -1, 0))
    fits = (apart <= alike_limit_m(distance)[:, None]) | ~(known & in_lane[:, None])
    reach, lane_reach = known.sum(axis=2), in_lane.sum(axis=1)[:, None]
    along = fits.all(axis=2) & (reach > 0) & (reach < lane_reach)
    for agent in np.flatnonzero(along.any(axis=1)).tolist():
        branch = int(np.argmax(along[agent]))
        begin, end = int(reach[agent, branch]), int(lane_reach[agent, 0])
        beside = features[agent, branch, begin - 1, :2] - way[agent, begin - 1]
        result[agent, branch, begin:end, :2] = way[agent, begin:end] + beside
        result[agent, branch, begin:end, 2] = features[agent, branch, 0, 2]
    return result
