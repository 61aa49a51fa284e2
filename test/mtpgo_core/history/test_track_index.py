# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sort keys of identities: exact, in the order of the numbers, for any of the 128 bits."""

import numpy as np

from mtpgo_core.history.track_index import TrackIndex, find_sort_keys, sort_keys
from mtpgo_core.identity import keys_from_integers

AWKWARD = [0, 1, 255, 256, 65536, 1 << 32, 1 << 64, (1 << 96) + 1, (1 << 128) - 1, 1 << 120]


def test_sort_keys_sort_like_the_numbers():
    keys = sort_keys(keys_from_integers(AWKWARD))
    order = np.argsort(keys)
    assert [AWKWARD[i] for i in order] == sorted(AWKWARD)
    assert len(np.unique(keys)) == len(AWKWARD)  # zero bytes at the ends count


def test_finds_exactly_the_keys_that_are_present():
    table = np.sort(sort_keys(keys_from_integers(AWKWARD)))
    assert find_sort_keys(table, table).tolist() == list(range(len(AWKWARD)))
    absent = sort_keys(keys_from_integers([2, 257, (1 << 64) - 1, (1 << 96)]))
    assert find_sort_keys(table, absent).tolist() == [-1] * 4
    assert find_sort_keys(table[:0], absent).tolist() == [-1] * 4


def test_slots_survive_adding_and_removing_other_keys():
    draw = np.random.default_rng(0)
    index, truth = TrackIndex(), {}
    for _ in range(50):
        ids = np.unique(draw.integers(0, 200, 8))
        new = [int(i) for i in ids if int(i) not in truth]
        if new:
            slots = draw.choice(10**9, len(new), replace=False)
            index.add(sort_keys(keys_from_integers(new)), slots)
            truth |= dict(zip(new, slots.tolist(), strict=True))
        rows = draw.random(len(index)) < 0.1
        freed = index.remove(rows)
        gone = [i for i, s in truth.items() if s in set(freed.tolist())]
        assert len(gone) == rows.sum()
        truth = {i: s for i, s in truth.items() if i not in gone}
    asked = list(range(200))
    found = index.find(sort_keys(keys_from_integers(asked)))
    assert found.tolist() == [truth.get(i, -1) for i in asked]
