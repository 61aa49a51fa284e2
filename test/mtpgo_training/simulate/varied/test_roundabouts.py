# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the kind ``roundabouts``: reproducible, consistent, without sudden motion."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_traffic import check_reproducible_and_smooth, needs_sumo

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.roundabout import ring_mouth
from mtpgo_training.simulate.varied.roundabouts import (
    RoundaboutsConfig,
    _draw_angles,
    simulate_roundabouts,
)


@needs_sumo
def test_a_recording_is_reproducible_and_its_motion_is_smooth() -> None:
    config = RoundaboutsConfig(seconds=6.0, seed=3, warm_up_s=25.0, radius_m=12.0, arms=5)
    check_reproducible_and_smooth(
        simulate_roundabouts, config, contains=AgentClass.CAR, sideways_mps=2.5
    )


@pytest.mark.parametrize(("radius", "lanes"), [(8.0, 1), (8.0, 2), (40.0, 2)])
def test_arms_leave_room_for_each_other(radius: float, lanes: int) -> None:
    least = 2 * ring_mouth(radius, lanes) + 0.3
    angles = _draw_angles(np.random.default_rng(0), 5, least)
    gaps = np.diff([*angles, angles[0] + 2 * np.pi])
    assert gaps.min() >= least - 1e-9
