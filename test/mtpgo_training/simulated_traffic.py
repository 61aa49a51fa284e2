# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the tests of simulated traffic share: a skip mark and checks of a recording."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo

Config = TypeVar("Config")


def _has_sumo() -> bool:
    try:
        return bool(sumo.program("sumo") and sumo.program("netconvert"))
    except sumo.SimulationError:
        return False


needs_sumo = pytest.mark.skipif(
    not _has_sumo(), reason="Eclipse SUMO is not installed (extra 'simulation')"
)


def check_consistent(recording: Recording, sideways_mps: float) -> None:
    """Check that positions, velocities and headings are consistent.

    Args:
        recording: a simulated recording.
        sideways_mps: limit of the lateral velocity (m/s).
    """
    for index in range(len(recording.track_id)):
        rows = np.flatnonzero(recording.track == index)
        if len(rows) < 10:
            continue
        assert (np.diff(recording.frame[rows]) >= 1).all()
        whole = np.diff(recording.frame[rows], n=1) == 1
        step = np.diff(recording.position[rows], axis=0) * recording.frame_rate
        mean = (recording.velocity[rows][1:] + recording.velocity[rows][:-1]) / 2
        np.testing.assert_allclose(step[whole], mean[whole], atol=0.25)
    cos, sin = np.cos(recording.yaw), np.sin(recording.yaw)
    sideways = recording.velocity[:, 1] * cos - recording.velocity[:, 0] * sin
    assert np.abs(sideways).max() < sideways_mps


def check_reproducible_and_smooth(
    simulate: Callable[[Config], Recording],
    config: Config,
    *,
    contains: AgentClass,
    sideways_mps: float,
) -> None:
    """Check that a configuration gives the same recording twice and that its motion is smooth.

    Args:
        simulate: makes the recording.
        config: of the simulation.
        contains: a class of road users that occurs.
        sideways_mps: limit of the lateral velocity (m/s).
    """
    recording = simulate(config)
    np.testing.assert_array_equal(recording.position, simulate(config).position)
    assert contains in recording.agent_class
    check_consistent(recording, sideways_mps)
    assert np.linalg.norm(recording.acceleration, axis=1).max() < 8.0
