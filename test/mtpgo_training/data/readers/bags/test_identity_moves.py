# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The counters of shared identities: those of the node's history, which is hardly ever asked."""

from collections import Counter

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.bags.identity_moves import BLOCK, identity_moves
from mtpgo_training.data.recording import FRAME_ID

START_NS = 10**18


def by_the_node(track, stamp_ns, position, key):
    """The counters of a history that gets every message."""
    history, counts = TrackHistory(HistoryConfig()), Counter()
    for stamp in np.unique(stamp_ns):
        rows = stamp_ns == stamp
        states = tracked_states(int(stamp), FRAME_ID, key[track[rows]], position[rows])
        report = history.update(states)
        counts.update(restarted=report.restarted, alternating=report.alternating)
    return +counts


def columns(tracks):
    """Return the arguments of ``identity_moves`` of [(stamps (s), positions [n, 2]), ...]."""
    track = np.repeat(np.arange(len(tracks)), [len(t) for t, _ in tracks])
    stamp_ns = START_NS + np.round(1e9 * np.concatenate([t for t, _ in tracks])).astype(np.int64)
    position = np.concatenate([p for _, p in tracks])
    order = np.lexsort((track, stamp_ns))
    key = np.zeros((len(tracks), 4), dtype=np.uint32)
    key[:, 0] = 100 - np.arange(len(tracks))
    return track[order], stamp_ns[order], position[order], key


def driven(draw, rate, seconds):
    """A track with changing speed and noise, now and then away, elsewhere or to and fro."""
    time_s = np.arange(round(rate * seconds)) / rate
    time_s = np.round(time_s + draw.uniform(0.0, 0.3 / rate, len(time_s)), 9)
    speed = np.clip(np.cumsum(draw.normal(0.0, 3.0 / rate**0.5, len(time_s))) + 25.0, 0.0, 60.0)
    x = np.cumsum(speed) / rate
    position = np.stack([x, 0.02 * x], axis=1) + draw.normal(0.0, draw.choice([0.05, 0.5]), (1, 2))
    position += draw.normal(0.0, draw.choice([0.0, 0.1, 0.6]), position.shape)
    for at in draw.integers(1, len(time_s), draw.integers(0, 4)).tolist():
        kind = draw.integers(4)
        if kind == 0:  # elsewhere from now on, by about as much as is just possible
            position[at:] += draw.uniform(3.0, 7.0) * draw.choice([-1.0, 1.0], 2)
        elif kind == 1:  # away, for about as long as the history remembers
            time_s[at:] += draw.uniform(3.0, 5.0)
        elif kind == 2:
            position[at : at + 12 : 2, 1] += draw.uniform(0.8, 3.0)
        else:  # a single wrong observation
            position[at] += draw.uniform(-6.0, 6.0, 2)
    return time_s, position


@pytest.mark.parametrize(("rate", "seconds"), [(1.0, 600.0), (10.0, 60.0), (60.0, 10.0)])
def test_the_counters_are_those_of_the_node(rate, seconds):
    draw = np.random.default_rng(round(rate))
    tracks = [driven(draw, rate, seconds * draw.uniform(0.05, 1.0)) for _ in range(16)]
    given = columns(tracks)
    expected = by_the_node(*given)
    assert +identity_moves(*given) == expected
    assert min(expected["restarted"], expected["alternating"]) > 0
    assert max(np.bincount(given[0])) > 2 * BLOCK


def test_no_rows_and_single_rows_have_no_counters():
    assert +identity_moves(*columns([(np.empty(0), np.empty((0, 2)))])) == {}
    assert (
        +identity_moves(*columns([(np.array([0.1 * n]), np.ones((1, 2))) for n in range(3)])) == {}
    )


@pytest.mark.parametrize("accelerated", [False, True])
def test_the_history_is_asked_about_no_road_user_that_moves_as_one(monkeypatch, accelerated):
    asked = []
    update = TrackHistory.update

    def noted(self, states, ego_key=None):
        asked.append(len(states))
        return update(self, states, ego_key)

    monkeypatch.setattr(TrackHistory, "update", noted)
    time_s = np.arange(6000) / 10.0
    x = 30.0 * time_s
    if accelerated:  # from 0 to 40 m/s and back, again and again
        x = 20.0 * time_s - 20.0 * np.sin(0.2 * time_s) / 0.2
    position = np.stack([x, np.zeros(len(x))], axis=1)
    position += np.random.default_rng(0).normal(0.0, 0.2, position.shape)
    assert +identity_moves(*columns([(time_s, position)])) == {}
    assert asked == []
    position[2000:] += 10.0
    assert +identity_moves(*columns([(time_s, position)])) == {"restarted": 1}
    assert len(asked) == 6000
