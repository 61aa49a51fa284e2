# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Jumps of the predicted point from cycle to cycle."""

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty.consistency import earlier_rows, jumps

H, DT = 25, 0.2


def test_the_latest_earlier_prediction_of_the_same_agent_is_found():
    track = np.array([7, 3, 7, 3, 9, 7])
    stamp_ns = np.array([0, 0, 200, 400, 400, 600]) * 1_000_000
    row, steps = earlier_rows(track, stamp_ns, H, DT)
    assert row.tolist() == [-1, -1, 0, 1, -1, 2]
    assert steps.tolist() == [0, 0, 1, 2, 0, 2]


@pytest.mark.parametrize(
    ("apart_s", "steps"), [(0.1, 1), (0.2, 1), (0.3, 3), (0.5, 5), (1.0, 5), (0.33, 0), (1.2, 0)]
)
def test_only_whole_steps_up_to_a_second_are_compared(apart_s, steps):
    stamp_ns = 1_500_000_000_000_000_000 + np.round(np.arange(8) * apart_s * 1e9).astype(np.int64)
    row, found = earlier_rows(np.zeros(8, np.int64), stamp_ns, H, DT)
    assert found[-1] == steps
    assert (row[-1] >= 0) == (steps > 0)


def test_a_short_horizon_limits_the_time_that_is_compared():
    stamp_ns = np.array([0, 400_000_000])
    assert earlier_rows(np.zeros(2, np.int64), stamp_ns, 3, DT)[1].tolist() == [0, 2]
    assert earlier_rows(np.zeros(2, np.int64), stamp_ns, 2, DT)[1].tolist() == [0, 0]
    assert earlier_rows(np.zeros(0, np.int64), stamp_ns[:0], H, DT)[0].shape == (0,)


def straight(speed, begin_s):
    """Return [1, H, 2] of someone who has driven straight on since 0 s."""
    time = begin_s + DT * np.arange(1, H + 1)
    return np.stack([speed * time, 0.0 * time], axis=-1)[None]


def test_whoever_drives_on_does_not_jump_and_a_new_speed_jumps_by_its_reach():
    row, steps = np.array([-1, 0, 1]), np.array([0, 1, 1])
    same = np.concatenate([straight(10.0, begin) for begin in (0.0, 0.2, 0.4)])
    found = jumps(same, row, steps)
    assert np.isnan(found[0])
    np.testing.assert_allclose(found[1:], 0.0, atol=1e-9)
    # From 0.2 s on at 11 m/s instead of 10: one metre for each of the remaining 4.8 s.
    faster = same.copy()
    faster[1, :, 0] += DT * np.arange(1, H + 1)
    assert jumps(faster, row, steps)[1] == pytest.approx(4.8)
