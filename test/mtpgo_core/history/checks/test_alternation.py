# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that two publishers share alternate; noisy, turning and braking ones do not."""

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig


def alternating(path, steps=40, dt_s=0.1):
    """Return how many observations of the track along ``path(step)`` count as alternating."""
    history, found = TrackHistory(HistoryConfig()), 0
    for step in range(steps):
        position = np.array([path(step)], dtype=np.float64)
        key = keys_from_integers([1])
        report = history.update(tracked_states(1 + round(step * dt_s * 1e9), "map", key, position))
        found += report.alternating
        assert report.restarted == 0
    return found


@pytest.mark.parametrize("offset", [(0.0, 2.5), (2.5, 0.0), (-2.0, 1.5)], ids=str)
@pytest.mark.parametrize("speed_mps", [0.0, 15.0])
def test_two_places_metres_apart(offset, speed_mps):
    found = alternating(
        lambda step: np.array([0.1 * speed_mps * step, 0.0]) + (step % 2) * np.array(offset)
    )
    assert 30 <= found <= 36


def test_noise_of_a_tracker():
    noise = np.random.default_rng(0).normal(0.0, 0.3, (400, 2))
    assert alternating(lambda step: (1.0 * step, 0.0) + noise[step], 400) == 0


def test_a_turn_and_full_braking():
    assert alternating(lambda step: (8 * np.cos(0.1 * step), 8 * np.sin(0.1 * step))) == 0
    assert alternating(lambda step: (min(step, 20) * 1.5, 0.0)) == 0


def test_a_single_outlier():
    assert alternating(lambda step: (1.0 * step, 3.0 * (step == 20))) == 0
