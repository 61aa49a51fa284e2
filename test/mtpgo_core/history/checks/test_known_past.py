# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Road users without a past: slow trackers, identities that do not last; ordinary traffic."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.history.checks.known_past import KnownPast
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig

CONFIG = HistoryConfig()


def problem(identities, interval_s=0.1, seconds=30.0, config=CONFIG):
    """Return the problem of a stream; ``identities(time_s)`` are those there at a time."""
    history, past, looked_s = TrackHistory(config), KnownPast(), 0.0
    for step in range(round(seconds / interval_s)):
        time_s = step * interval_s
        there = np.asarray(identities(time_s), dtype=np.int64)
        key = keys_from_integers(there)
        position = np.stack([10.0 * there, np.full(len(key), 2.0 * time_s)], axis=1)
        stamp_ns = 1 + round(time_s * 1e9)
        history.update(tracked_states(stamp_ns, "map", key, position))
        past.observed(stamp_ns)
        if time_s - looked_s >= 1.0:
            past.look(history.window(), config.dt_s)
            looked_s = time_s
    return past.problem(config.max_gap_s)


@pytest.mark.parametrize("interval_s", [0.6, 1.0, 2.0])
def test_a_slow_tracker(interval_s):
    found = problem(lambda time_s: range(5), interval_s, 60.0)
    assert f"objects come every {interval_s:g} s, and the history bridges 0.5 s" in found
    assert "expected at least 2 Hz" in found


def test_a_history_that_bridges_nothing():
    config = dataclasses.replace(CONFIG, max_gap_s=0.0)
    found = problem(lambda time_s: range(5), 0.13, config=config)
    assert found.endswith("the objects come every 0.13 s, and the history bridges 0 s")


def test_identities_that_do_not_last():
    found = problem(lambda time_s: np.arange(5) + 5 * round(10 * time_s))
    assert "their identities do not last" in found


@pytest.mark.parametrize(
    ("identities", "interval_s"),
    [
        (lambda time_s: range(5), 0.04),
        (lambda time_s: range(5), 0.5),
        # Each is seen for two seconds, as on a narrow view across a road.
        (lambda time_s: np.arange(5) + round(2.5 * time_s), 0.1),
        # A tenth of the identities are new in each message, as of false detections.
        (lambda time_s: [*range(9), 100 + round(10 * time_s)], 0.1),
        (lambda time_s: [], 0.1),
    ],
)
def test_ordinary_streams(identities, interval_s):
    assert problem(identities, interval_s) == ""


def test_the_start_gives_no_verdict():
    assert problem(lambda time_s: range(50), seconds=4.0) == ""
