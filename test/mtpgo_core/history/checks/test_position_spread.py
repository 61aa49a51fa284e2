# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Road users that are all in one place, as where positions are in degrees."""

import numpy as np

from mtpgo_core.history.checks.position_spread import PositionSpread
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig


def problem(places, looks=30):
    """Return the problem where ``places(second)`` [n, 2] are the positions."""
    history, spread = TrackHistory(HistoryConfig()), PositionSpread()
    for second in range(looks):
        position = np.asarray(places(second), dtype=np.float64).reshape(-1, 2)
        key = keys_from_integers(range(len(position)))
        history.update(tracked_states(1 + second * 10**9, "map", key, position))
        spread.look(history.window())
    return spread.problem


def test_degrees():
    found = problem(lambda second: [[8.5 + 1e-4 * second, 49.0], [8.5, 49.001], [8.501, 49.0]])
    assert "3 road users at a time are within 0.0029 m; is the unit of the positions" in found


def crowd(*steps):
    """Return three places, the last of them ``steps`` (m) beside the others."""
    return [[0.0, 0.0], [0.1, 0.0], list(steps)]


def test_other_places():
    assert problem(lambda second: crowd(2.0, 0.0)) == ""
    assert problem(lambda second: np.add(crowd(0.2, 0.0), [0.5 * second, 0.0])) == ""  # moving
    assert problem(lambda second: crowd(0.2, 0.0)[:2]) == ""  # one that is there twice
    assert problem(lambda second: []) == ""
    assert problem(lambda second: crowd(0.2, 0.0), looks=9) == ""
    assert problem(lambda second: crowd(0.2 + 5.0 * (second == 25), 0.0)) == ""
