# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ring of trail points against a plain list."""

import bisect

import numpy as np
import pytest

from mtpgo_core.scene.trails.trail_points import PointColumns, TrailPoints


def points_at(times_ns):
    new = PointColumns.empty(len(times_ns))
    new.time_ns[:] = times_ns
    new.trail[:] = times_ns
    return new


@pytest.mark.parametrize("capacity", [7, 5000, 20_000])
def test_numbers_and_times_are_those_of_a_list_of_which_the_first_are_dropped(capacity):
    rng = np.random.default_rng(0)
    ring, times = TrailPoints(capacity), []
    now = 0
    for _ in range(100 if capacity < 20_000 else 700):
        now += int(rng.integers(1, 4))
        count = int(rng.integers(0, 60))
        number = ring.append(points_at([now] * count))
        np.testing.assert_array_equal(number, len(times) + np.arange(count))
        times += [now] * count
        assert ring.count == len(times)
        assert ring.count - ring.oldest <= capacity
        for asked in (0, now // 2, now - 1, now, now + 1):
            assert ring.known_at(asked) == max(bisect.bisect_right(times, asked), ring.oldest)
            assert ring.since(asked) == max(bisect.bisect_left(times, asked), ring.oldest)
    kept = np.arange(ring.oldest, ring.count)
    assert len(kept) == min(capacity, len(times))
    np.testing.assert_array_equal(ring.column("time_ns", kept), np.array(times)[kept])


def test_links_of_points_that_are_overwritten_are_dropped():
    ring = TrailPoints(4)
    ring.append(points_at([1, 2]))
    ring.append(points_at([3, 4, 5]))
    ring.link(np.array([0, 2]), np.array([4, 4]))
    assert ring.column("following", np.array([1, 2, 3, 4])).tolist() == [0, 2, 0, 0]


def test_memory_grows_with_the_points_up_to_the_capacity():
    ring = TrailPoints(100_000)
    first = ring.nbytes
    ring.append(points_at(range(60_000)))
    assert first < ring.nbytes
    ring.append(points_at(range(60_000, 120_000)))
    assert ring.nbytes == PointColumns.empty(100_000).nbytes
