# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the kind ``junctions``: reproducible, consistent, without sudden motion."""

from __future__ import annotations

from simulated_traffic import check_reproducible_and_smooth, needs_sumo

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.varied.junctions import JunctionsConfig, simulate_junctions


@needs_sumo
def test_a_recording_is_reproducible_and_its_motion_is_smooth() -> None:
    config = JunctionsConfig(
        seconds=6.0, seed=3, warm_up_s=25.0, right_of_way="priority", bicycle_share=0.3
    )
    check_reproducible_and_smooth(
        simulate_junctions, config, contains=AgentClass.PEDESTRIAN, sideways_mps=1.6
    )
