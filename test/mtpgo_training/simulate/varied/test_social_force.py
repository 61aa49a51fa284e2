# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The social force model: simple encounters."""

from __future__ import annotations

import numpy as np
import pytest

from mtpgo_training.simulate.varied.social_force import Crowd, SocialForceConfig


def walk(position: list, desired: list, seconds: float, walls: float = np.inf) -> Crowd:
    """Return a crowd after walking."""
    crowd = Crowd(
        position=np.array(position),
        velocity=np.array(desired),
        desired=np.array(desired),
        group=np.arange(len(position)),
        present=np.ones(len(position), dtype=np.bool_),
    )
    for _ in range(round(seconds / 0.05)):
        crowd.step(0.05, SocialForceConfig(), walls)
    return crowd


def test_alone_the_desired_velocity_is_kept() -> None:
    crowd = walk([[0.0, 0.0]], [[1.3, 0.0]], 2.0)
    np.testing.assert_allclose(crowd.velocity, [[1.3, 0.0]], atol=1e-9)
    np.testing.assert_allclose(crowd.position, [[2.6, 0.0]], atol=1e-9)


def test_two_who_meet_pass_each_other_without_touching() -> None:
    crowd = walk([[0.0, 0.05], [8.0, -0.05]], [[1.3, 0.0], [-1.3, 0.0]], 0.0)
    least = np.inf
    for _ in range(160):
        crowd.step(0.05, SocialForceConfig(), np.inf)
        least = min(least, float(np.linalg.norm(crowd.position[0] - crowd.position[1])))
    assert crowd.position[0, 0] > 7.0 > 1.0 > crowd.position[1, 0]
    assert least > 0.4


def test_a_wall_is_not_crossed() -> None:
    crowd = walk([[0.0, 0.0]], [[1.0, 1.0]], 10.0, walls=2.0)
    assert 1.0 < crowd.position[0, 1] < 2.0
    assert crowd.velocity[0, 0] == pytest.approx(1.0, abs=1e-3)


def test_those_who_are_not_present_neither_move_nor_repel() -> None:
    crowd = walk([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]], 0.0)
    crowd.present[1] = False
    crowd.step(0.05, SocialForceConfig(), np.inf)
    np.testing.assert_allclose(crowd.position, [[0.05, 0.0], [1.0, 0.0]], atol=1e-9)
