# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the kind ``crowd``: reproducible, consistent, without sudden motion."""

from __future__ import annotations

from simulated_traffic import check_reproducible_and_smooth

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.varied.crowd import CrowdConfig, simulate_crowd


def test_a_recording_is_reproducible_and_its_motion_is_smooth() -> None:
    config = CrowdConfig(seconds=6.0, seed=3, warm_up_s=25.0, place="plaza", in_view=15.0)
    check_reproducible_and_smooth(
        simulate_crowd, config, contains=AgentClass.PEDESTRIAN, sideways_mps=1.0
    )
