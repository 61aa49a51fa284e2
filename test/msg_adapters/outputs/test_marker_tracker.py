# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stable marker ids, and the markers to delete."""

import numpy as np

from msg_adapters.outputs.marker_tracker import MODES_PER_AGENT, MarkerTracker
from mtpgo_core.identity import keys_from_integers


def test_slots_are_reused_only_after_all_were_used():
    tracker = MarkerTracker(_next=2**31 // MODES_PER_AGENT - 1)
    key = np.arange(8, dtype=np.uint32).reshape(2, 4)
    assert tracker.slots(key[:1]) == [2**31 // MODES_PER_AGENT - 1]
    assert tracker.slots(key) == [2**31 // MODES_PER_AGENT - 1, 0]
    assert (2**31 // MODES_PER_AGENT - 1) * MODES_PER_AGENT + 255 == 2**31 - 1


def test_an_agent_keeps_its_slot_whatever_the_order():
    tracker = MarkerTracker()
    assert tracker.slots(keys_from_integers([30, 10, 20])) == [0, 1, 2]
    assert tracker.slots(keys_from_integers([20, 30, 10])) == [2, 0, 1]


def test_an_agent_that_was_gone_gets_a_slot_never_used_before():
    tracker = MarkerTracker()
    assert tracker.slots(keys_from_integers([1, 2])) == [0, 1]
    assert tracker.slots(keys_from_integers([2])) == [1]
    assert tracker.slots(keys_from_integers([1, 2, 3])) == [2, 1, 3]
    assert tracker.slots(keys_from_integers([])) == []


def test_slots_in_use_are_passed_over_after_the_last_number():
    tracker = MarkerTracker()
    assert tracker.slots(keys_from_integers([1, 2])) == [0, 1]
    tracker._next = 2**31 // MODES_PER_AGENT - 1
    assert tracker.slots(keys_from_integers([1, 2, 3, 4]))[2:] == [2**31 // MODES_PER_AGENT - 1, 2]


def test_markers_missing_from_the_new_message_are_to_be_deleted_once():
    tracker = MarkerTracker()
    assert tracker.stale({("boxes", 1), ("lines", 1), ("lines", 2)}) == []
    assert tracker.stale({("lines", 1)}) == [("boxes", 1), ("lines", 2)]
    assert tracker.stale({("lines", 1)}) == []
    assert tracker.stale(set()) == [("lines", 1)]
