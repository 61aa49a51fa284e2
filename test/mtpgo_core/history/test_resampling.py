# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The samples around grid times, by hand-worked numbers."""

import math

import numpy as np
import pytest

from mtpgo_core.history.resampling import (
    NEVER_NS,
    bracket,
    fill_backwards,
    interpolate_angle,
    interpolate_linear,
)

MS, NAN = 1_000_000, np.nan
GRID_MS = np.array([0, 200, 400, 600, 800])


def brackets_of(*stamps_ms):
    """Brackets of one track; None for an empty sample."""
    stamps = [NEVER_NS if s is None else s * MS for s in stamps_ms]
    return bracket(
        np.array([stamps]), GRID_MS * MS, max_gap_ns=500 * MS, max_extrapolation_ns=300 * MS
    )


def test_between_two_samples_the_fraction_of_the_way():
    found = brackets_of(None, 100, 300, 800)
    # 0: before the first sample; 600: in the gap of 500 ms, which is still interpolated.
    assert found.valid.tolist() == [[False, True, True, True, True]]
    assert found.left[0, 1:].tolist() == [1, 2, 2, 3]
    assert found.right[0, 1:].tolist() == [2, 3, 3, 3]
    assert found.fraction[0, 1:] == pytest.approx([0.5, 0.2, 0.6, 0.0])
    assert found.after_s.tolist() == [0.0]


def test_a_longer_gap_is_not_interpolated_and_exact_samples_stay():
    found = brackets_of(200, 701, 800)
    assert found.valid.tolist() == [[False, True, False, False, True]]
    assert found.fraction.tolist() == [[0.0] * 5]


def test_grid_times_that_are_years_apart():
    """So many tracks with so long a grid do not fit into one range of 64 bits."""
    year_ns = 365 * 86_400 * 1_000_000_000
    stamps = np.array([[NEVER_NS, 100 * MS, 300 * MS], [0, year_ns, 50 * year_ns]] * 20)
    grid = np.array([200 * MS, 50 * year_ns])
    found = bracket(stamps, grid, max_gap_ns=500 * MS, max_extrapolation_ns=-1)
    assert found.valid.tolist() == [[True, False], [False, True]] * 20
    assert found.left.tolist() == [[1, 2], [0, 2]] * 20
    assert found.fraction[0, 0] == pytest.approx(0.5)


@pytest.mark.parametrize(("last_ms", "valid"), [(500, True), (499, False)])
def test_only_the_last_grid_time_is_extrapolated_and_not_too_far(last_ms, valid):
    found = brackets_of(None, 400, last_ms)
    assert found.valid[0, 3:].tolist() == [False, valid]
    assert found.after_s[0] == pytest.approx(0.001 * (800 - last_ms) if valid else 0.0)
    assert found.left[0, 4] == 2


def test_samples_after_the_last_grid_time_are_ignored():
    found = brackets_of(600, 700, 900)
    assert found.valid[0, 3:].tolist() == [True, True]
    assert found.left[0, 4] == found.right[0, 4] == 1
    assert found.after_s[0] == pytest.approx(0.1)


def test_stamps_within_a_microsecond_are_the_same_time():
    stamps = np.array([[200 * MS + 1000, 400 * MS - 1000]])
    found = bracket(stamps, GRID_MS * MS, max_gap_ns=500 * MS, max_extrapolation_ns=0)
    assert found.valid.tolist() == [[False, True, True, False, False]]
    assert found.left[0, 1:3].tolist() == [0, 1]


def test_tracks_do_not_affect_each_other():
    rows = [[NEVER_NS, 100, 300], [0, 200, 400], [NEVER_NS] * 3, [500, 700, 10_000]]
    stamps = np.array([[s if s == NEVER_NS else s * MS for s in row] for row in rows])
    limits = {"max_gap_ns": 500 * MS, "max_extrapolation_ns": 300 * MS}
    together = bracket(stamps, GRID_MS * MS, **limits)
    for i in range(len(rows)):
        alone = bracket(stamps[i : i + 1], GRID_MS * MS, **limits)
        for name in ("valid", "fraction", "after_s"):
            np.testing.assert_array_equal(getattr(together, name)[i], getattr(alone, name)[0])
    assert not together.valid[2].any()


def test_interpolation_uses_the_known_side():
    left, right = np.array([1.0, NAN, 3.0, NAN]), np.array([2.0, 5.0, NAN, NAN])
    value = interpolate_linear(left, right, np.full(4, 0.25))
    assert value[:3].tolist() == [1.25, 5.0, 3.0]
    assert np.isnan(value[3])


def test_angles_take_the_shorter_arc():
    left, right = np.array([3.0, -3.0, 0.5, NAN]), np.array([-3.0, 3.0, 1.0, 2.0])
    arc = 2.0 * math.pi - 6.0
    value = interpolate_angle(left, right, np.array([0.25, 0.25, 0.5, 0.5]))
    assert value == pytest.approx([3.0 + 0.25 * arc, -3.0 - 0.25 * arc, 0.75, 2.0])


def test_only_unknown_first_values_are_filled_from_the_first_known_one():
    values = np.array([[NAN, NAN, 3.0, NAN, 5.0], [NAN, NAN, NAN, NAN, NAN]])
    valid = np.array([[False, True, True, True, True], [True] * 5])
    filled = fill_backwards(values, valid)
    np.testing.assert_array_equal(filled[0], [NAN, 3.0, 3.0, 5.0, 5.0])
    assert np.isnan(filled[1]).all()
