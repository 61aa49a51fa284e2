# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where earlier road users went from an agent's position, as model input (``scene.trails``)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import own_heading, rotate
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.trails.class_groups import PEDESTRIAN, class_groups, floor_mps
from mtpgo_core.scene.trails.lane_ways import lane_ways, with_lane_ways
from mtpgo_core.scene.trails.trail_branches import BRANCHES, branches
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.scene.trails.trail_paths import Places, trail_paths
from mtpgo_core.schema import Float32Array, HistoryWindow

COLUMNS = 3
"""Columns of a branch at a step: ahead (m), left (m), share."""


@dataclass(frozen=True)
class TrailContext:
    """A memory of trails, and the horizon and time limit with which it is queried.

    Attributes:
        memory: the trails.
        horizon_steps: H.
        dt_s: step of the horizon (s).
        since_ns: only points that became known at this time or later are used (ns), None for all.
    """

    memory: TrailMemory
    horizon_steps: int
    dt_s: float
    since_ns: int | None = None


def trail_features(
    window: HistoryWindow, context: TrailContext, lanes: LaneMap | None = None
) -> Float32Array:
    """Return [n, R, H, 3] branches of the trails ahead of each agent, the heaviest first.

    Everything is in the agent's own frame: x along :func:`~mtpgo_core.frames.own_heading`. At step
    k a branch is looked at after s_k, the distance covered by then at the agent's present speed:

    * 0: how far its point is ahead of straight-on motion, x(s_k) - s_k (m);
    * 1: how far it is to the left, y(s_k) (m);
    * 2: the branch's share of the earlier road users where it is known so far, else 0, as are the
      other two.

    Agents that are not present at the window's time have none.

    Args:
        window: the history up to t.
        context: the memory; points that became known after t are not used.
        lanes: lane lines in the window's frame, used where no trail is known, except for
            pedestrians.
    """
    features = np.zeros((len(window), BRANCHES, context.horizon_steps, COLUMNS), dtype=np.float32)
    present = np.flatnonzero(window.valid[:, -1])
    velocity, group = window.velocity[present, -1], class_groups(window.agent_class[present])
    places = Places(
        key=window.key[present],
        group=group,
        position=window.position[present, -1],
        heading=own_heading(velocity, window.yaw[present, -1]),
    )
    speed = np.nan_to_num(np.hypot(velocity[:, 0], velocity[:, 1]))
    ahead = np.maximum(speed, floor_mps(group))[:, None] * (
        context.dt_s * np.arange(1, context.horizon_steps + 1)
    )
    paths = trail_paths(context.memory, places, window.stamp_ns, ahead, context.since_ns)
    found = branches(paths, ahead)
    known = np.arange(context.horizon_steps) < found.reach[..., None]
    features[present, ..., 0] = np.where(known, found.ahead - ahead[:, None], 0.0)
    features[present, ..., 1] = found.left
    features[present, ..., 2] = np.where(known, found.share[..., None], 0.0)
    if lanes is not None:
        heading = np.where(group == PEDESTRIAN, np.nan, places.heading)
        way, _ = lane_ways(lanes, places.position, heading, ahead)
        own = rotate(way - places.position[:, None], -places.heading[:, None])
        features[present] = with_lane_ways(features[present], own[..., 0], own[..., 1], ahead)
    return features
