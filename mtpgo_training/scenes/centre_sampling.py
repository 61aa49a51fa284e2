# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which agents are the centres of an epoch's graphs, and how often."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_core.task.task_description import SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.windows import Windows

STANDING_MPS = 0.3
"""An agent slower than this is standing (m/s); chosen above the jitter of standing tracks."""

STANDING_M = 0.5
"""An agent whose observed future stays this close to its position does not move (m); chosen above
the jitter of standing tracks."""

FUTURES_AT_ONCE = 8192
"""Agents whose futures are looked up together; chosen, bounds the memory."""


@dataclass(frozen=True)
class Candidates:
    """The agents of a window that may be the centre of a graph.

    Attributes:
        index: [p] their rows in the window.
        position: [p, 2] positions at the window's time (m).
        chance: [p] chance of each to be a centre.
        changes: [p] their lane changes, see
            :func:`mtpgo_training.scenes.lane_change_balancing.lane_changes`; empty where graphs
            are not balanced.
    """

    index: NDArray[np.int64]
    position: Float64Array
    chance: Float64Array
    changes: NDArray[np.int8]


def draw_cover(
    candidates: Candidates, scene: SceneConfig, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Draw centres in random order such that every agent drawn by its chance is in a graph.

    The neighbourhoods are those of the node's policy ``cover`` (nearest first, limited in number
    and radius), but each draw gives other centres.

    Args:
        candidates: the agents present.
        scene: limits of a graph.
        rng: source of the draw.

    Returns:
        [c] rows of the centres in the window.
    """
    present, position = candidates.index, candidates.position
    uncovered = rng.random(len(present)) < candidates.chance
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    centres = []
    for i in rng.permutation(len(present)):
        if not uncovered[i]:
            continue
        centres.append(present[i])
        near = np.argsort(distance[i], kind="stable")[: scene.max_neighbours + 1]
        uncovered[near[distance[i, near] <= scene.radius_m]] = False
        uncovered[i] = False
    return np.array(centres, dtype=np.int64)


def graph_sizes(
    candidates: Candidates, centres: NDArray[np.int64], scene: SceneConfig
) -> NDArray[np.int64]:
    """Return [c] the number of agents in the graphs around [c] centres, rows of the candidates."""
    middle = candidates.position[np.searchsorted(candidates.index, centres)]
    distance = np.linalg.norm(candidates.position[None] - middle[:, None], axis=-1)
    near: NDArray[np.int64] = (distance <= scene.radius_m).sum(axis=1)
    return np.minimum(near, scene.max_neighbours + 1)


def standing(
    features: NDArray[np.float32], target: Float64Array, known: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return [N] whether an agent is standing at t and stays where it is.

    Args:
        features: [N, T, F] features of the scene, x, y, vx, vy first.
        target: [N, H, 4] future x, y, vx, vy in the scene frame.
        known: [N, H] whether they were observed.
    """
    speed = np.hypot(features[:, -1, 2], features[:, -1, 3])
    moved = np.linalg.norm(target[..., :2] - features[:, -1:, :2], axis=-1)
    return (speed < STANDING_MPS) & (np.where(known, moved, 0.0).max(axis=-1) < STANDING_M)


def centre_chances(
    windows: Windows, recording: Recording, future: FutureTable, data: DataConfig, dt_s: float
) -> Float64Array:
    """Return [p] the chance of each agent of the windows to be the centre of a graph.

    It follows ``min_future_s``, ``standing_chance`` and ``centre_classes`` of
    :class:`~mtpgo_training.data.data_config.DataConfig`. The rows are those of
    ``windows.instants``.
    """
    instants = windows.instants
    chance = np.ones(len(instants.track))
    if data.min_future_s > 0.0 or data.standing_chance < 1.0:
        steps = max(1, round(max(data.min_future_s, 2.0) / dt_s))
        stamp_ns = instants.stamp_ns[instants.window]
        for begin in range(0, len(chance), FUTURES_AT_ONCE):
            some = slice(begin, begin + FUTURES_AT_ONCE)
            ahead = future.at(instants.track[some], stamp_ns[some], steps, dt_s)
            moved = np.linalg.norm(ahead.position - instants.position[some][:, None], axis=-1)
            speed = np.nan_to_num(np.linalg.norm(instants.velocity[some], axis=-1))
            stands = np.where(ahead.known, moved, 0.0).max(axis=1) < STANDING_M
            stands &= speed < STANDING_MPS
            long_enough = ahead.known.sum(axis=1) >= round(data.min_future_s / dt_s)
            chance[some] = np.where(stands, data.standing_chance, 1.0) * long_enough
    if data.centre_classes:
        classes = [AgentClass.from_name(name) for name in data.centre_classes]
        chance *= np.isin(recording.agent_class, classes)[instants.track]
    return chance


def copies(weight: float, rng: np.random.Generator) -> int:
    """Return how often a window is drawn, ``weight`` times on average."""
    whole = int(weight)
    return whole + int(rng.random() < weight - whole)
