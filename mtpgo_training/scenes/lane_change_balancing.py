# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Balancing of lane changes: graphs around lane changes are repeated, those around others thinned.

Lane changes are rare, and a model that never sees them predicts none. The paper oversamples them
and undersamples lane keeping on highD; docs/recordings.md says how that is read here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.manoeuvres import label, members
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.centre_sampling import FUTURES_AT_ONCE, Candidates
from mtpgo_training.scenes.windows import Windows

NO_MANOEUVRE = 2
"""Mark of an agent that neither changes nor keeps a lane."""


def lane_changes(
    windows: Windows, recording: Recording, future: FutureTable, horizon_steps: int, dt_s: float
) -> NDArray[np.int8]:
    """Return [p] the lane change of each agent of the windows over the horizon.

    1 is a change to the left, -1 a change to the right, 0 lane keeping, and ``NO_MANOEUVRE``
    neither (the agent stands, turns, is no vehicle, or is not observed over the whole horizon), as
    defined in :mod:`mtpgo_training.data.manoeuvres`. The rows are those of ``windows.instants``.
    """
    instants = windows.instants
    out = np.full(len(instants.track), NO_MANOEUVRE, dtype=np.int8)
    dt_ns = round(dt_s * 1e9)
    stamp_ns = instants.stamp_ns[instants.window]
    for begin in range(0, len(out), FUTURES_AT_ONCE):
        some = slice(begin, begin + FUTURES_AT_ONCE)
        track = instants.track[some]
        path = future.at(track, stamp_ns[some] - dt_ns, horizon_steps + 1, dt_s)
        classes = recording.agent_class[track]
        labels = label(path.position, path.known, dt_s, classes, recording.lanes)
        for name, value in (("lane_keep", 0), ("change_left", 1), ("change_right", -1)):
            out[some][members(labels, name)] = value
    return out


def balanced_copies(
    sources: Sequence[tuple[NDArray[np.int8], Float64Array]], share: float, copies_each: float
) -> dict[int, float]:
    """Return how often an agent is drawn as a centre, by its lane change.

    Changes to the left and to the right are drawn equally often, ``copies_each`` graphs for each
    change on average, and lane keeping so rarely that ``share`` of all graphs are lane changes.
    (Where too few agents keep their lane, each is drawn once and the share is larger.) Agents
    without a manoeuvre are not drawn.

    Args:
        sources: of every recording, [p] the :func:`lane_changes` of its agents and [p] the chance
            or weight by which an agent counts.
        share: share of lane changes among the graphs.
        copies_each: graphs around an agent that changes its lane.

    Raises:
        ConfigurationError: no agent changes its lane.
    """
    count = {
        value: sum(float(chance[found == value].sum()) for found, chance in sources)
        for value in (-1, 0, 1)
    }
    changes = count[-1] + count[1]
    if not changes > 0.0:
        raise ConfigurationError(
            "data.lane_change_share is set but no agent changes its lane in the recordings of "
            "data.train, expected 0 for such traffic"
        )
    wanted = dict.fromkeys((-1, 0, 1, NO_MANOEUVRE), 0.0)
    for side in (-1, 1):
        if count[side] > 0.0:
            sides = 2 if count[-side] > 0.0 else 1
            wanted[side] = copies_each * changes / (sides * count[side])
    keep = copies_each * changes * (1.0 - share) / share
    wanted[0] = min(1.0, keep / count[0]) if count[0] > 0.0 else 0.0
    return wanted


def draw_balanced(
    candidates: Candidates, wanted: Mapping[int, float], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Draw the centres of a window, each as often as its lane change asks for on average.

    Args:
        candidates: the agents that may be a centre.
        wanted: result of :func:`balanced_copies`.
        rng: source of the draw.

    Returns:
        [c] rows of the centres in the window.
    """
    mean = np.array([wanted[int(change)] for change in candidates.changes]) * candidates.chance
    whole = np.floor(mean).astype(np.int64)
    often = whole + (rng.random(len(mean)) < mean - whole)
    return np.repeat(candidates.index, often)
