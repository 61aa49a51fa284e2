# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Slots of tracks: allocation, growth, eviction, and the attributes kept in them."""

import numpy as np
import pytest
from core_helpers import S_NS, states_of

from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.history.track_store import SAMPLE_COLUMNS, TrackStore
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.task.task_description import HistoryConfig

NONE = np.empty(0, dtype=np.intp)


def keys(*ids):
    return sort_keys(keys_from_integers(sorted(ids)))


def store_of(max_tracks=4):
    return TrackStore(HistoryConfig(), max_tracks, keep_ns=4 * S_NS)


def observe(store, slot, stamp_s):
    """Append one sample, all of whose values are the slot's number, to each slot."""
    sample = np.repeat(slot[:, None].astype(float), SAMPLE_COLUMNS, axis=1)
    store.rings.append(slot, round(stamp_s * S_NS), sample)


def test_new_tracks_get_different_slots_and_are_found_under_their_keys():
    store = store_of()
    slot, dropped = store.allocate(keys(7, 5, 9), NONE)
    assert dropped == 0
    assert len(set(slot.tolist())) == 3
    assert store.index.find(keys(5, 7, 9)).tolist() == slot.tolist()
    assert store.index.find(keys(6)).tolist() == [-1]
    assert store.allocate(keys(), NONE)[0].shape == (0,)


def test_a_full_store_evicts_the_track_unseen_for_longest_and_never_one_of_the_message():
    store = store_of(max_tracks=3)
    slot, _ = store.allocate(keys(1, 2, 3), NONE)
    for i, seen_s in enumerate((0.2, 0.1, 0.3)):  # track 2 is the oldest, then track 1
        observe(store, slot[i : i + 1], seen_s)
    # Track 2 is in the message: track 1 goes although it was seen later.
    new, dropped = store.allocate(keys(8), others=slot[1:2])
    assert dropped == 1
    assert new.tolist() == [slot[0]]
    assert (store.index.find(keys(1, 2, 3, 8)) >= 0).tolist() == [False, True, True, True]


def test_the_surplus_of_a_message_gets_no_slot():
    store = store_of(max_tracks=3)
    old, _ = store.allocate(keys(1, 2), NONE)
    observe(store, old, 0.0)
    # Room for three, of which one is taken by track 1 of the same message.
    new, dropped = store.allocate(keys(4, 5, 6, 7), others=old[:1])
    assert (new >= 0).tolist() == [True, True, False, False]
    assert dropped == 3  # tracks 6 and 7, and track 2, which was evicted
    assert len(store.index) == 3


def test_tracks_unseen_since_a_time_are_released():
    store = store_of()
    slot, _ = store.allocate(keys(1, 2, 3), NONE)
    for i, seen_s in enumerate((1.0, 2.0, 3.0)):
        observe(store, slot[i : i + 1], seen_s)
    assert store.forget_before(2 * S_NS) == 1  # a track seen at that very time is kept
    assert (store.index.find(keys(1, 2, 3)) >= 0).tolist() == [False, True, True]
    assert store.forget_before(2 * S_NS) == 0


def test_growing_keeps_samples_and_attributes():
    store = store_of(max_tracks=1000)
    first, _ = store.allocate(keys(1, 2), NONE)
    observe(store, first, 1.0)
    states = states_of(1.0, [1, 2], [[0, 0], [1, 1]], z=[3.0, 4.0], size=[[4, 2], [5, 2]])
    store.update_attributes(first, states, np.array([0, 1]))
    many, dropped = store.allocate(keys(*range(10, 510)), NONE)
    assert dropped == 0
    assert len(set(many.tolist()) | set(first.tolist())) == 502
    assert store.rings.capacity >= 502
    assert store.rings.last[first, 0].tolist() == first.tolist()
    assert store.z[first].tolist() == [3.0, 4.0]
    assert np.isnan(store.rings.last[many]).all()
    assert np.isnan(store.z[many]).all()
    assert np.isnan(store.position_velocity[many]).all()


def test_a_reset_slot_is_empty_and_stays_assigned():
    store = store_of()
    slot, _ = store.allocate(keys(1), NONE)
    observe(store, slot, 1.0)
    states = states_of(1.0, [1], [[0, 0]], z=[3.0], agent_class=np.uint8([2]))
    store.update_attributes(slot, states, np.array([0]))
    store.reset(slot)
    assert store.rings.count[slot].tolist() == [0]
    assert (store.agent_class[slot][0], np.isnan(store.z[slot][0])) == (0, True)
    assert store.index.find(keys(1)).tolist() == slot.tolist()


def test_unknown_attributes_keep_their_last_known_value():
    store = store_of()
    slot, _ = store.allocate(keys(1), NONE)
    covariance = np.eye(4)[None]
    first = states_of(
        0.0,
        [1],
        [[0, 0]],
        z=[2.0],
        size=[[4.0, 2.0]],
        agent_class=np.uint8([1]),
        covariance=covariance,
    )
    second = states_of(0.1, [1], [[0, 0]], size=[[np.nan, 2.5]])
    for states in (first, second):
        store.update_attributes(slot, states, np.array([0]))
    assert store.agent_class[slot].tolist() == [1]
    assert store.z[slot].tolist() == [2.0]
    assert store.size[slot].tolist() == [[4.0, 2.5]]
    # A covariance belongs to its own observation.
    assert np.isnan(store.covariance[slot]).all()


def test_of_a_first_change_of_velocity_half_is_noise_where_both_are_as_large():
    """Two velocities differ by 0.141 m/s of noise, and by as much after 0.064 s at 2.2 m/s^2."""
    acceleration = TrackStore(
        HistoryConfig(acceleration_tau_s=1000.0), max_tracks=1, keep_ns=4 * S_NS
    ).acceleration
    slot, after_s = np.array([0]), 2**0.5 * 0.1 / 2.2
    acceleration.step(slot, np.array([0.0]), np.array([[5.0, 0.0]]))
    found = acceleration.step(slot, np.array([after_s]), np.array([[5.3, 0.0]]))
    np.testing.assert_allclose(found, [[0.5 * 0.3 / after_s, 0.0]], rtol=1e-3)


@pytest.mark.parametrize("max_tracks", [1, 64, 65])
def test_every_limit_can_be_filled(max_tracks):
    store = store_of(max_tracks)
    slot, dropped = store.allocate(keys(*range(100)), NONE)
    assert (slot >= 0).sum() == max_tracks
    assert dropped == 100 - max_tracks
