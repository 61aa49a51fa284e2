# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rings against plain lists."""

import numpy as np
import pytest

from mtpgo_core.history.resampling import NEVER_NS
from mtpgo_core.history.sample_rings import SampleRings

KEEP_NS = 3_500_000_000
MS = 1_000_000


def stored(rings, slot):
    """Stamps and samples of one slot, oldest first."""
    stamps, place = rings.in_order(np.array([slot]))
    samples = rings.samples(np.array([slot]), place)[0]
    there = stamps[0] != NEVER_NS
    return stamps[0][there], samples[there]


@pytest.mark.parametrize("period_ms", [200, 40, 10, 6])
def test_keeps_every_sample_of_the_span(period_ms):
    rings = SampleRings(3, 2, KEEP_NS)
    for k in range(1500):
        rings.append(np.array([1]), k * period_ms * MS, np.array([[k, -k]]))
        if k % 7 == 0:  # a slower neighbour in the same rings
            rings.append(np.array([2]), k * period_ms * MS, np.array([[k, k]]))
    for slot, every, sign in ((1, 1, -1), (2, 7, 1)):
        expected = [k for k in range(0, 1500, every) if (1499 - k) * period_ms * MS <= KEEP_NS]
        stamps, samples = stored(rings, slot)
        kept = stamps[-len(expected) :]
        assert kept.tolist() == [k * period_ms * MS for k in expected]
        tail = samples[-len(expected) :]
        assert tail.tolist() == [[k, sign * k] for k in expected]
    assert stored(rings, 0)[0].size == 0


def test_a_track_that_becomes_faster_loses_nothing():
    rings = SampleRings(2, 1, KEEP_NS)
    sent, now = [], 0
    for k in range(900):
        now += (100 if k < 333 else 10) * MS
        rings.append(np.array([1]), now, np.array([[k]]))
        sent.append((now, k))
        if k % 50 == 0:
            stamps, samples = stored(rings, 1)
            expected = [s for s in sent if s[0] >= now - KEEP_NS]
            got = list(zip(stamps.tolist(), samples[:, 0].tolist(), strict=True))
            assert got[-len(expected) :] == expected
            assert stamps.tolist() == sorted(stamps.tolist())


def test_faster_than_200_hz_keeps_the_newest_and_a_bounded_past():
    rings = SampleRings(1, 1, KEEP_NS)
    for k in range(10_000):
        rings.append(np.array([0]), k * MS, np.array([[k]]))
        assert rings.last[0, 0] == k
    stamps, samples = stored(rings, 0)
    assert stamps[-1] == 9_999 * MS
    assert samples[-1, 0] == 9_999
    assert (np.diff(stamps) >= 0).all()
    assert np.diff(stamps[:-1]).min() >= 5 * MS  # all but the newest are thinned
    assert stamps[-1] - stamps[0] >= KEEP_NS
    assert stamps.size < 800


def test_growing_keeps_what_is_there_and_blank_empties():
    rings = SampleRings(2, 1, KEEP_NS)
    for k in range(100):
        rings.append(np.array([0, 1]), k * 20 * MS, np.array([[k], [10 * k]]))
    rings.grow(5)
    assert rings.capacity == 5
    assert stored(rings, 1)[1][-1, 0] == 990
    assert stored(rings, 4)[0].size == 0
    assert rings.last_ns[4] == NEVER_NS
    rings.clear(np.array([0]))
    assert stored(rings, 0)[0].size == 0
    assert np.isnan(rings.last[0]).all()
    rings.append(np.array([0]), 5, np.array([[7.0]]))
    assert stored(rings, 0)[0].tolist() == [5]
