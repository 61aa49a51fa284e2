# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the kind ``junctions``: reproducible, consistent, without sudden motion."""

from __future__ import annotations

import numpy as np
from simulated_traffic import check_consistent, needs_sumo

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.varied.junctions import JunctionsConfig, simulate_junctions


@needs_sumo
def test_a_recording_is_reproducible_and_its_motion_is_smooth() -> None:
    config = JunctionsConfig(
        seconds=6.0, seed=3, warm_up_s=25.0, right_of_way="priority", bicycle_share=0.3
    )
    recording = simulate_junctions(config)
    np.testing.assert_array_equal(recording.position, simulate_junctions(config).position)
    assert AgentClass.PEDESTRIAN in recording.agent_class
    check_consistent(recording, sideways_mps=1.6)
    assert np.linalg.norm(recording.acceleration, axis=1).max() < 8.0
