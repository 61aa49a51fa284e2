# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Generated traffic: no vehicle jumps, and velocities are those of the positions."""

import numpy as np
import pytest

from msg_adapters.ring_traffic import RingTraffic


@pytest.mark.parametrize("agents", [1, 7, 128])
def test_velocity_and_heading_are_those_of_the_motion(agents):
    traffic = RingTraffic(agents)
    states = traffic.at(10.0, 5)
    before, after = traffic.at(9.999, 4).position, traffic.at(10.001, 6).position
    moved = (after - before) / 0.002
    np.testing.assert_allclose(states.velocity, moved, atol=1e-4)
    np.testing.assert_allclose(np.tan(states.yaw), moved[:, 1] / moved[:, 0], rtol=1e-3)
    speed = np.linalg.norm(moved, axis=1)
    assert speed.min() > 13.9
    assert speed.max() < 22.1
    assert states.stamp_ns == 5
    assert len(np.unique(states.key, axis=0)) == agents


def test_more_vehicles_make_a_longer_road_of_the_same_density():
    def neighbours(agents: int) -> float:
        position = RingTraffic(agents).at(0.0, 0).position
        distance = np.linalg.norm(position[:, None] - position[None], axis=2)
        return float((distance < 60.0).sum(axis=1).mean())

    assert neighbours(512) == pytest.approx(neighbours(256), rel=0.1)


def test_half_of_them_drive_in_the_other_direction():
    states = RingTraffic(60).at(0.0, 0)
    (x, y), (vx, vy) = states.position.T, states.velocity.T
    spin = x * vy - y * vx
    assert (spin > 0).sum() == 30
