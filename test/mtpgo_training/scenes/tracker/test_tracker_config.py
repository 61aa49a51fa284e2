# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trackers drawn from ranges."""

import math

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.scenes.tracker.tracker_config import TrackerConfig, ideal_tracker


def draws(count=400, **changes):
    rng = np.random.default_rng(0)
    config = TrackerConfig(**changes)
    return [config.draw(rng) for _ in range(count)]


def test_drawn_trackers_are_within_the_ranges_and_differ():
    config, drawn = TrackerConfig(), draws(ideal_share=0.0)
    for name in ("position_std_m", "drift_std_m", "drift_time_s", "rate_hz", "birth_s"):
        low, high = getattr(config, name)
        values = np.array([getattr(tracker, name) for tracker in drawn])
        assert low <= values.min() < values.max() <= high
        assert np.ptp(values) > 0.8 * (high - low)
    assert {t.yaw_source for t in drawn} == {"course", "box", "none"}
    for share, chosen in (
        (config.acceleration_share, [t.order == 3 for t in drawn]),
        (config.clear_share, [t.dropout_share == 0.0 for t in drawn]),
        (config.no_velocity_share, [not t.gives_velocity for t in drawn]),
        (config.no_yaw_share, [t.yaw_source == "none" for t in drawn]),
        (config.course_share, [t.yaw_source == "course" for t in drawn]),
        (config.unclassified_share, [t.unknown_class_share == 1.0 for t in drawn]),
        (config.some_classified_share, [0.0 < t.unknown_class_share < 1.0 for t in drawn]),
        (config.no_size_share, [not t.gives_size for t in drawn]),
    ):
        assert np.mean(chosen) == pytest.approx(share, abs=0.08)


def test_a_share_is_ideal():
    drawn = draws()
    ideal = [t for t in drawn if t.position_std_m == 0.0]
    assert len(ideal) / len(drawn) == pytest.approx(0.2, abs=0.06)
    for tracker in ideal:
        assert tracker.birth_s == tracker.dropout_share == tracker.unknown_class_share == 0.0
        assert tracker.gives_velocity
        assert tracker.rate_hz == math.inf
    assert ideal_tracker().order == 3


def test_a_seed_gives_the_same_tracker():
    first, second = (TrackerConfig().draw(np.random.default_rng(7)) for _ in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rate_hz": (0.0, 5.0)}, "tracker.rate_hz is 0.0, expected more than 0"),
        ({"dropout_share": (0.0, 1.0)}, "tracker.dropout_share is 1.0"),
        ({"no_yaw_share": 0.7}, "tracker.course_share and tracker.no_yaw_share add up to 1.1"),
        ({"some_classified_share": 0.9}, "add up to 1.05, expected at most 1"),
    ],
)
def test_impossible_ranges_are_errors(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        TrackerConfig(**changes)
