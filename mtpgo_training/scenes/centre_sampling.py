# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which graphs an epoch draws: around whom, and how often."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass, Float64Array, HistoryWindow
from mtpgo_core.task.task_description import SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.manoeuvres import label, members
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.windows import Windows

STANDING_MPS = 0.3
"""An agent slower than this stands (m/s)."""

STANDING_M = 0.5
"""An agent whose observed future stays within this of its position does not move (m)."""

NO_MANOEUVRE = 2
"""Of an agent that neither changes nor keeps a lane."""

AT_ONCE = 8192
"""Agents looked ahead for together, which bounds the memory."""


@dataclass(frozen=True)
class Candidates:
    """Those of a window who may be a graph's centre.

    Attributes:
        index: [p] their places in the window.
        position: [p, 2] where they are at its time (m).
        chance: [p] chance of each to be a centre.
        changes: [p] what each does, see :func:`lane_changers`; empty where nothing is balanced.
    """

    index: NDArray[np.int64]
    position: Float64Array
    chance: Float64Array
    changes: NDArray[np.int8]


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
    no_changes = np.empty(0, dtype=np.int8)
    position = window.position[present, -1]
    candidates = Candidates(present, position, wanted[present], no_changes)
    return draw_cover(candidates, scene, rng)


def draw_cover(
    candidates: Candidates, scene: SceneConfig, rng: np.random.Generator
) -> NDArray[np.int64]:
    """:func:`random_cover` of agents of which only the present state is known."""
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
    """[c] agents of the graphs around ``centres`` [c], which are among the candidates."""
    middle = candidates.position[np.searchsorted(candidates.index, centres)]
    distance = np.linalg.norm(candidates.position[None] - middle[:, None], axis=-1)
    near: NDArray[np.int64] = (distance <= scene.radius_m).sum(axis=1)
    return np.minimum(near, scene.max_neighbours + 1)


def standing(
    features: NDArray[np.float32], target: Float64Array, known: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """[N] agents that stand at t and stay where they are."""
    speed = np.hypot(features[:, -1, 2], features[:, -1, 3])
    moved = np.linalg.norm(target[..., :2] - features[:, -1:, :2], axis=-1)
    return (speed < STANDING_MPS) & (np.where(known, moved, 0.0).max(axis=-1) < STANDING_M)


def centre_chances(
    windows: Windows, recording: Recording, future: FutureTable, data: DataConfig, dt_s: float
) -> Float64Array:
    """[p] chance of each agent of the windows to be a graph's centre.

    See ``min_future_s``, ``standing_weight`` and ``centre_classes`` of
    :class:`~mtpgo_training.training.training_config.DataConfig`. The rows are those of
    ``windows.instants``.
    """
    instants = windows.instants
    chance = np.ones(len(instants.track))
    if data.min_future_s > 0.0 or data.standing_weight < 1.0:
        steps = max(1, round(max(data.min_future_s, 2.0) / dt_s))
        stamp_ns = instants.stamp_ns[instants.window]
        for begin in range(0, len(chance), AT_ONCE):
            some = slice(begin, begin + AT_ONCE)
            ahead = future.at(instants.track[some], stamp_ns[some], steps, dt_s)
            moved = np.linalg.norm(ahead.position - instants.position[some][:, None], axis=-1)
            speed = np.nan_to_num(np.linalg.norm(instants.velocity[some], axis=-1))
            stands = np.where(ahead.known, moved, 0.0).max(axis=1) < STANDING_M
            stands &= speed < STANDING_MPS
            long_enough = ahead.known.sum(axis=1) >= round(data.min_future_s / dt_s)
            chance[some] = np.where(stands, data.standing_weight, 1.0) * long_enough
    if data.centre_classes:
        classes = [AgentClass.from_name(name) for name in data.centre_classes]
        chance *= np.isin(recording.agent_class, classes)[instants.track]
    return chance


def lane_changers(
    windows: Windows, recording: Recording, future: FutureTable, horizon_steps: int, dt_s: float
) -> NDArray[np.int8]:
    """[p] what each agent of the windows does over the horizon, by the recording.

    1 changes to the left, -1 changes to the right, 0 keeps its lane, ``NO_MANOEUVRE`` does neither
    (it stands, turns, is no vehicle, or is not seen for the whole horizon); as
    :mod:`mtpgo_training.data.manoeuvres` defines them. The rows are those of ``windows.instants``.
    """
    instants = windows.instants
    out = np.full(len(instants.track), NO_MANOEUVRE, dtype=np.int8)
    dt_ns = round(dt_s * 1e9)
    stamp_ns = instants.stamp_ns[instants.window]
    for begin in range(0, len(out), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        track = instants.track[some]
        path = future.at(track, stamp_ns[some] - dt_ns, horizon_steps + 1, dt_s)
        classes = recording.agent_class[track]
        labels = label(path.position, path.known, dt_s, classes, recording.lanes)
        for name, value in (("lane_keep", 0), ("change_left", 1), ("change_right", -1)):
            out[some][members(labels, name)] = value
    return out


def balanced_copies(
    sources: Sequence[tuple[NDArray[np.int8], Float64Array]], share: float, lane_changes: float
) -> dict[int, float]:
    """How often an agent is drawn as a centre, by what it does, so that lane changes are balanced.

    Lane changes to either side are drawn equally often, ``lane_changes`` graphs for each on
    average, and those that keep their lane so seldom that ``share`` of all graphs are lane
    changes. (If there are too few who keep their lane, each is drawn once and the share is
    larger.) Agents without a manoeuvre are not drawn.

    Args:
        sources: of every recording, [p] :func:`lane_changers` and [p] the chance and weight by
            which the agent counts.
        share: of lane changes among the graphs.
        lane_changes: graphs around an agent that changes its lane.

    Raises:
        ConfigurationError: nobody changes a lane.
    """
    count = {
        value: sum(float(chance[found == value].sum()) for found, chance in sources)
        for value in (-1, 0, 1)
    }
    changes = count[-1] + count[1]
    if not changes > 0.0:
        raise ConfigurationError(
            "data.lane_change_share is set but nobody changes a lane in the recordings of "
            "data.train, expected 0 for such traffic"
        )
    copies = dict.fromkeys((-1, 0, 1, NO_MANOEUVRE), 0.0)
    for side in (-1, 1):
        if count[side] > 0.0:
            sides = 2 if count[-side] > 0.0 else 1
            copies[side] = lane_changes * changes / (sides * count[side])
    keep = lane_changes * changes * (1.0 - share) / share
    copies[0] = min(1.0, keep / count[0]) if count[0] > 0.0 else 0.0
    return copies


def draw_balanced(
    candidates: Candidates, wanted: Mapping[int, float], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Centres of a window, each as often as what it does asks for on average.

    Args:
        candidates: who may be a centre.
        wanted: what :func:`balanced_copies` gave.
        rng: the draw.
    """
    mean = np.array([wanted[int(change)] for change in candidates.changes]) * candidates.chance
    whole = np.floor(mean).astype(np.int64)
    often = whole + (rng.random(len(mean)) < mean - whole)
    return np.repeat(candidates.index, often)


def copies(weight: float, rng: np.random.Generator) -> int:
    """How often a window is drawn: ``weight`` on average."""
    whole = int(weight)
    return whole + int(rng.random() < weight - whole)
