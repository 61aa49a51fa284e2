# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which graphs an epoch draws: around whom, and how often."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array, HistoryWindow
from mtpgo_core.task import SceneConfig
from mtpgo_training.config import DataConfig
from mtpgo_training.futures import FutureTable
from mtpgo_training.recording import Recording
from mtpgo_training.windows import TrackedWindow

STANDING_MPS = 0.3
"""An agent slower than this stands (m/s)."""

STANDING_M = 0.5
"""An agent whose observed future stays within this of its position does not move (m)."""


def random_cover(
    window: HistoryWindow,
    scene: SceneConfig,
    rng: np.random.Generator,
    chance: Float64Array | None = None,
) -> NDArray[np.int64]:
    """Centres in random order such that every agent valid at t lies in the graph of one.

    The same neighbourhoods as the node's ``cover`` (nearest first, limited in number and radius),
    but other centres at every draw.

    Args:
        window: the history.
        scene: limits of a graph.
        rng: the draw.
        chance: [n] chance of each agent to be a centre if none has covered it; 1 by default.
    """
    wanted = np.ones(len(window)) if chance is None else chance
    present = np.flatnonzero(window.valid[:, -1])
    uncovered = rng.random(len(present)) < wanted[present]
    position = window.position[present, -1]
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


def standing(
    features: NDArray[np.float32], target: Float64Array, known: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """[N] agents that stand at t and stay where they are."""
    speed = np.hypot(features[:, -1, 2], features[:, -1, 3])
    moved = np.linalg.norm(target[..., :2] - features[:, -1:, :2], axis=-1)
    return (speed < STANDING_MPS) & (np.where(known, moved, 0.0).max(axis=-1) < STANDING_M)


def centre_chances(
    tracked: TrackedWindow,
    recording: Recording,
    future: FutureTable,
    data: DataConfig,
    dt_s: float,
) -> Float64Array:
    """[tracks] chance to be a graph's centre, see ``min_future_s`` and ``standing_weight``."""
    chance = np.ones(len(recording.track_id))
    if data.min_future_s <= 0.0 and data.standing_weight >= 1.0:
        return chance
    window = tracked.window
    steps = max(1, round(max(data.min_future_s, 2.0) / dt_s))
    ahead = future.at(tracked.track, window.stamp_ns, steps, dt_s)
    moved = np.linalg.norm(ahead.position - window.position[:, -1:], axis=-1)
    speed = np.nan_to_num(np.linalg.norm(window.velocity[:, -1], axis=-1))
    stands = (np.where(ahead.known, moved, 0.0).max(axis=1) < STANDING_M) & (speed < STANDING_MPS)
    long_enough = ahead.known.sum(axis=1) >= round(data.min_future_s / dt_s)
    chance[tracked.track] = np.where(stands, data.standing_weight, 1.0) * long_enough
    return chance


def copies(weight: float, rng: np.random.Generator) -> int:
    """How often a window is drawn: ``weight`` on average."""
    whole = int(weight)
    return whole + int(rng.random() < weight - whole)
