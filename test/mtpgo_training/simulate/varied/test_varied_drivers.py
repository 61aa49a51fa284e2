# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drivers from wide ranges."""

from __future__ import annotations

import numpy as np
import pytest

from mtpgo_training.simulate.varied import varied_drivers as drivers


def test_drivers_differ_in_model_and_motion() -> None:
    types, probability = drivers.draw_varied_types(
        np.random.default_rng(0), {"car": 0.8, "pedestrian": 0.2}
    )
    assert probability.sum() == pytest.approx(1.0)
    cars = [kind for kind in types if kind.label == "car"]
    assert {kind.attributes["carFollowModel"] for kind in cars} == {"EIDM", "IDM", "Krauss"}
    assert len({kind.motion for kind in cars}) == len(cars)
    assert all(kind.motion.trailing for kind in cars)
    walkers = [kind for kind in types if kind.label == "pedestrian"]
    assert walkers
    assert not any(kind.motion.trailing for kind in walkers)


def test_walking_speeds_are_between_the_limits() -> None:
    generator = np.random.default_rng(0)
    speeds = [drivers.draw_walking_speed(generator) for _ in range(500)]
    assert min(speeds) >= 0.6
    assert max(speeds) <= 2.0
    assert np.mean(speeds) == pytest.approx(1.34, abs=0.05)


def test_shares_of_the_motor_traffic_sum_to_one() -> None:
    shares = drivers.motor_shares(np.random.default_rng(0), 0.3, 0.1)
    assert shares["truck"] == 0.3
    assert sum(shares.values()) == pytest.approx(1.0)
