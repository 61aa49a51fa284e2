# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From the history window to the model's input, for training and the node alike.

Only agents present at the common time t are part of a scene: one that left before t can neither be
predicted nor influence the others' future. :func:`build_scenes` leaves the others out before
anything else, so that graphs and contexts are the same in training, evaluation and node. Only with
``departed_agents`` they remain, in the graphs of the past. See docs/design.md, decisions 12 to 14.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import rotate, wrap
from mtpgo_core.scene.departed_agents import with_departed
from mtpgo_core.scene.graph_selection import GraphState, choose_graphs, graphs_around
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.leader_context import leader_features
from mtpgo_core.scene.track_summary import track_summary
from mtpgo_core.scene.traffic_context import traffic_features
from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.schema import (
    MOVING_MPS,
    AgentClass,
    BoolArray,
    ClassArray,
    Float32Array,
    Float64Array,
    HistoryWindow,
    IndexArray,
    KeyArray,
    SceneBatch,
)
from mtpgo_core.task.task_description import LANE_CONTEXTS, SceneConfig

SIZE_SCALES = (10.0, 3.0)
"""What length and width are divided by (m); chosen: most road users come out below 1."""

LARGEST_SIZE = 3.0
"""Largest scaled size; chosen: 30 m, longer than a lorry with its trailer."""

_Number = TypeVar("_Number", np.float32, np.float64)

_BY_AGENT = {"leaders": leader_features, "traffic": traffic_features, "road": leader_features}
"""Contexts that do not depend on the graph: computed once per agent."""


def build_scenes(
    window: HistoryWindow,
    config: SceneConfig,
    *,
    ego_key: KeyArray | None = None,
    previous: GraphState | None = None,
    centres: IndexArray | None = None,
    served: BoolArray | None = None,
    lanes: LaneMap | None = None,
    trails: TrailContext | None = None,
) -> SceneBatch:
    """Return graphs, scene frames and features of the agents present at the window's time.

    In each graph the centre comes first, then its neighbours by ascending distance.

    Args:
        window: the history.
        config: policy, limits, frame, context and classes.
        ego_key: [4] the agent of the ``ego`` policy.
        previous: the state of the previous cycle, read and updated (``cover``, ``ego``,
            ``scene``); without it every call chooses independently.
        centres: [B] positions in the window; forces one graph around each of these agents, all
            members primary. This is how training cuts its samples.
        served: [n] the agents that are predicted, all by default. The others are neighbours in the
            graphs and in the contexts of those, but neither centres nor primary. Without effect
            where ``centres`` are given.
        lanes: lane lines in the window's frame, for tasks that use lanes.
        trails: where road users went, for tasks with ``trails``.

    Returns:
        The batch, padded up to its largest graph; B = 0 if no agent is present.

    Raises:
        ConfigurationError: a centre that is not present at t, or lanes or trails needed and not
            given.
    """
    present = np.flatnonzero(window.valid[:, -1])
    here = window if len(present) == len(window) else window.select(present)
    if centres is None:
        chosen = None if served is None else served[present]
        graphs = choose_graphs(here, config, ego_key=ego_key, state=previous, served=chosen)
    else:
        centres = np.asarray(centres, dtype=np.intp).reshape(-1)
        if not np.isin(centres, present).all():
            raise ConfigurationError(
                "centres names an agent that is not present at the window's time, expected "
                "positions in the window where valid[:, -1] is true"
            )
        graphs = graphs_around(here, config, np.searchsorted(present, centres))
    member, primary = graphs.members, graphs.primary
    if config.departed_agents and here is not window:
        member = np.where(member >= 0, present[member], -1)
        member, primary = with_departed(window, member, primary, config)
        here, present = window, np.arange(len(window))
    origin, rotation = scene_frames(here, config, member[:, 0])
    real = member >= 0
    valid = here.valid[member] & real[..., None]
    return SceneBatch(
        features=_features(here, config, member, valid, origin, rotation, lanes),
        valid=valid,
        static=static_features(here, config)[member] * real[..., None],
        origin=origin,
        rotation=rotation,
        agent=np.where(real, present[member], -1).astype(np.int64),
        primary=primary,
        trails=_trails(here, config, np.where(valid[..., -1], member, -1), trails, lanes),
    )


def scene_frames(
    window: HistoryWindow, config: SceneConfig, centre: IndexArray
) -> tuple[Float64Array, Float64Array]:
    """Return origins [B, 2] (m) and rotations [B] (rad) of the scene frames around ``centre``.

    ``centre_heading``: at the centre agent, x along its yaw (0 where that was never known).
    ``driving_direction``: at the centre agent, x along the fixed frame's +x or, for an agent that
    drives towards -x, along -x (the paper's highway frame). ``site_origin``: at the configured
    point, not turned (the paper's roundabouts and junctions).
    """
    if config.frame == "site_origin":
        origin = np.broadcast_to(np.array(config.site_origin, dtype=np.float64), (len(centre), 2))
        return origin.copy(), np.zeros(len(centre))
    yaw = np.nan_to_num(window.yaw[centre, -1])
    if config.frame == "driving_direction":
        velocity = np.nan_to_num(window.velocity[centre, -1])
        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING_MPS
        forward = np.where(moving, velocity[:, 0], np.cos(yaw)) >= 0.0
        yaw = np.where(forward, 0.0, np.pi)
    return window.position[centre, -1], yaw


def static_features(window: HistoryWindow, config: SceneConfig) -> Float32Array:
    """Return [n, C] the static features, in the order of ``SceneConfig.static_features``.

    The one-hot class; with ``config.sizes`` length and width (divided by ``SIZE_SCALES``) and 1,
    all three 0 where the tracker gives no size; with ``config.track_summary`` what
    :func:`~mtpgo_core.scene.track_summary.track_summary` returns.
    """
    columns: list[NDArray[Any]] = [class_one_hot(window.agent_class, config.classes)]
    if config.sizes:
        columns.append(_sizes(window.size))
    if config.track_summary:
        columns.append(track_summary(window))
    return np.concatenate(columns, axis=1).astype(np.float32)


def _sizes(size: Float64Array) -> Float64Array:
    """Return [n, 3] scaled length and width, and whether they are known."""
    known = (np.nan_to_num(size, nan=0.0, posinf=0.0) > 0.0).all(axis=1, keepdims=True)
    scaled = np.where(known, np.nan_to_num(size) / SIZE_SCALES, 0.0)
    return np.concatenate([np.minimum(scaled, LARGEST_SIZE), known], axis=1)


def class_one_hot(agent_class: ClassArray, classes: tuple[str, ...]) -> Float32Array:
    """Return [n, C] one-hot classes, all zero for a class that is not in ``classes``."""
    return _one_hot_table(classes)[agent_class]


@functools.cache
def _one_hot_table(classes: tuple[str, ...]) -> Float32Array:
    """Return [256, C] the one-hot row of each class value."""
    table = np.zeros((256, len(classes)), dtype=np.float32)
    for column, name in enumerate(classes):
        value = AgentClass.from_name(name)
        if value != AgentClass.UNKNOWN or name == "unknown":
            table[value, column] = 1.0
    table.setflags(write=False)
    return table


def _features(
    window: HistoryWindow,
    config: SceneConfig,
    agent: IndexArray,
    valid: NDArray[np.bool_],
    origin: Float64Array,
    rotation: Float64Array,
    lanes: LaneMap | None,
) -> Float32Array:
    """Return [B, N, T, F] in the order of ``SceneConfig.features``.

    The origin is subtracted in float64, so a distant map origin costs no precision. A velocity or
    acceleration that was never known is 0, a yaw that was never known is the scene's x axis.
    """
    turn, radians = -rotation[:, None, None], config.angles == "radians"
    position = rotate(window.position[agent] - origin[:, None, None], turn)
    yaw = window.yaw[agent] + turn
    yaw = np.where(np.isnan(yaw), 0.0, yaw)
    columns = [
        position,
        rotate(window.velocity[agent], turn),
        rotate(window.acceleration[agent], turn),
        wrap(yaw)[..., None] if radians else np.stack([np.cos(yaw), np.sin(yaw)], axis=-1),
    ]
    if config.context == "polar":
        columns.append(_polar(position, radians))
    elif config.context in _BY_AGENT:
        around, reach_m = _BY_AGENT[config.context], config.leader_reach_m
        columns.append(_once_per_agent(agent, lambda some: around(window, some, reach_m)))
    if config.context in LANE_CONTEXTS:
        road = _needed(lanes, f"the model's context is {config.context!r}")
        placed = _once_per_agent(
            agent, lambda some: road.positions(window.position[some], window.yaw[some])
        )
        if config.context == "road":  # an agent outside of all lanes is not in the middle of one
            columns.append(np.isfinite(placed[..., :1]).astype(np.float64))
        columns.append(placed)
    features = np.nan_to_num(np.concatenate(columns, axis=-1), nan=0.0)
    features[~valid] = 0.0
    return features.astype(np.float32)


def _once_per_agent(
    agent: IndexArray, values_of: Callable[[IndexArray], NDArray[_Number]]
) -> NDArray[_Number]:
    """Return [B, N, ...] the values of each agent, computed once per agent.

    Args:
        agent: [B, N] positions in the window; an agent may be in several graphs.
        values_of: returns [m, ...] values of m agents.
    """
    members, place = np.unique(agent, return_inverse=True)
    return values_of(members)[place.reshape(agent.shape)]


def _needed(lanes: LaneMap | None, what: str) -> LaneMap:
    if lanes is None:
        raise ConfigurationError(
            f"{what} but no lane lines are given, expected a lane map (--lane-file)"
        )
    return lanes


def _trails(
    window: HistoryWindow,
    config: SceneConfig,
    agent: IndexArray,
    trails: TrailContext | None,
    lanes: LaneMap | None,
) -> Float32Array | None:
    """Return [B, N, R, H, 3] the trail features of the agents, None if the task has none."""
    if not config.trails:
        return None
    if trails is None:
        raise ConfigurationError(
            "the task has scene.trails but no memory of trails is given, expected a TrailContext"
        )
    road = _needed(lanes, "the task has scene.lane_ways") if config.lane_ways else None
    of_agent = _once_per_agent(
        agent, lambda some: trail_features(window.select(some), trails, road)
    )
    of_agent[agent < 0] = 0.0
    return of_agent


def _polar(position: Float64Array, radians: bool) -> Float64Array:
    """Return distance and direction from the scene's origin (polar context, eq. (4)).

    The direction is the cosine and sine of the angle, counter-clockwise from the scene's x axis.
    With ``radians`` it is the paper's theta = arctan2(y_0 - y, x - x_0), which is clockwise. At
    the origin, where arctan2 depends on the signs of zeros, the angle is 0.
    """
    r = np.hypot(position[..., 0], position[..., 1])
    at_origin = r == 0.0
    if radians:
        theta = np.arctan2(-position[..., 1], position[..., 0])
        return np.stack([r, np.where(at_origin, 0.0, theta)], axis=-1)
    divisor = np.where(at_origin, 1.0, r)
    cos = np.where(at_origin, 1.0, position[..., 0] / divisor)
    return np.stack([r, cos, position[..., 1] / divisor], axis=-1)
