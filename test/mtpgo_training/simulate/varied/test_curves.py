# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the kind ``curves``: reproducible, consistent, without sudden motion."""

from __future__ import annotations

from simulated_traffic import check_reproducible_and_smooth, needs_sumo

from mtpgo_core.schema import AgentClass
from mtpgo_training.simulate.varied.curves import CurvesConfig, simulate_curves


@needs_sumo
def test_a_recording_is_reproducible_and_its_motion_is_smooth() -> None:
    config = CurvesConfig(seconds=6.0, seed=3, warm_up_s=25.0, style="lane")
    check_reproducible_and_smooth(
        simulate_curves, config, contains=AgentClass.CAR, sideways_mps=1.5
    )
