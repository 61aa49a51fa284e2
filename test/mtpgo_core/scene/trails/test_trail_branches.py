# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Distinct continuations of a place: at a junction, on a bend, beside a ramp."""

import numpy as np
import pytest
from trail_lines import S_NS, bend, drive

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.scene.trails.class_groups import MOTOR
from mtpgo_core.scene.trails.trail_branches import BRANCHES, branches
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.scene.trails.trail_paths import CANDIDATES, Places, TrailPaths, trail_paths

DISTANCE_M = np.arange(1.0, 41.0)[None]


def made(*lines):
    """Paths of one agent: (y as a function of x, weight, reach) each."""
    ahead, left = np.zeros((2, 40, 1, CANDIDATES), dtype=np.float32)
    reach, weight = np.zeros((1, CANDIDATES), dtype=np.int64), np.zeros((1, CANDIDATES))
    for place, (course, of_it, known) in enumerate(lines):
        ahead[:known, 0, place] = DISTANCE_M[0, :known]
        left[:known, 0, place] = course(DISTANCE_M[0, :known])
        reach[0, place], weight[0, place] = known, of_it
    return TrailPaths(ahead, left, reach, weight.astype(np.float32))


def off(slope):
    return lambda x: slope * x


def test_each_branch_has_the_weight_of_its_paths_and_their_mean():
    found = branches(
        made(
            (off(0.5), 1.0, 40),
            (off(0.01), 2.0, 40),
            (off(-0.01), 1.0, 40),
            (off(0.52), 0.5, 40),
            (off(-0.6), 0.5, 40),
        ),
        DISTANCE_M,
    )
    assert found.share[0].tolist() == pytest.approx([0.6, 0.3, 0.1])
    assert (found.reach == 40).all()
    slope = found.left[0, :, -1] / 40.0
    assert slope.tolist() == pytest.approx([0.01 / 3.0, 0.5 * 2 / 3 + 0.52 / 3, -0.6], abs=1e-6)


def test_a_fourth_branch_is_left_out():
    lines = [(off(s), w, 40) for s, w in ((0.0, 4.0), (0.3, 3.0), (0.6, 2.0), (0.9, 1.0))]
    assert branches(made(*lines), DISTANCE_M).share[0].tolist() == pytest.approx([0.4, 0.3, 0.2])


def test_a_path_known_for_less_supports_what_it_agrees_with_and_does_not_stand_for_it():
    found = branches(
        made((off(0.0), 1.0, 6), (off(0.4), 1.0, 40), (off(0.0), 0.9, 40)), DISTANCE_M
    )
    assert found.reach[0].tolist() == [40, 40, 0]
    assert found.share[0].tolist() == pytest.approx([2.0 / 2.9, 0.9 / 2.9, 0.0], abs=1e-6)
    assert found.left[0, 0, -1] == pytest.approx(16.0)


def test_no_paths_give_no_branches():
    found = branches(made(), DISTANCE_M)
    assert not found.share.any()
    assert not found.reach.any()
    assert not found.ahead.any()


@pytest.mark.parametrize("at_m", [-12.0, -3.0])
def test_a_junction_has_its_three_ways_on(at_m):
    memory, start_s = TrailMemory(), 0.0
    for ident, turn in enumerate((0, 1, 0, -1, 1, 0)):
        start_s = drive(memory, bend(turn), ident=ident, start_s=start_s, aside_m=0.1 * turn)
    places = Places(
        keys_from_integers([50]), np.array([MOTOR]), np.array([[at_m, 0.0]]), np.zeros(1)
    )
    paths = trail_paths(memory, places, round(start_s * S_NS), DISTANCE_M)
    found = branches(paths, DISTANCE_M)
    assert BRANCHES == 3
    assert found.share[0].tolist() == pytest.approx([0.5, 0.34, 0.16], abs=0.03)
    side = np.sign(np.round(found.left[0, :, -1]))
    assert side.tolist() == [0.0, 1.0, -1.0]
