# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a sender's clock was set, from times of sending and receipt."""

import numpy as np
import pytest

from mtpgo_ros.runtime.sender_clock import SenderClock

S_NS = 1_000_000_000
SENT_NS = 1_700_000_000 * S_NS
"""The sender's clock at the start; the monotonic one of the receiver is then at 0."""


def noticed(sent_s, received_s, set_by_s=0.0, set_at_s=np.inf):
    """Return at which times of sending (s) it is noticed that the clock was set."""
    clock, found = SenderClock(), []
    for sent, received in zip(sent_s, received_s, strict=True):
        shown_s = sent + (set_by_s if sent >= set_at_s else 0.0)
        if clock.was_set_forward(SENT_NS + round(shown_s * S_NS), round(received * S_NS)):
            found.append(sent)
    return found


@pytest.mark.parametrize(
    ("set_by_s", "seen"),
    [(3600.0, True), (2.0, True), (0.6, True), (0.3, False), (-2.0, False), (-3600.0, False)],
)
def test_a_clock_that_is_set_forward_is_noticed_once(set_by_s, seen):
    sent_s = 0.1 * np.arange(600)
    delay_s = np.random.default_rng(0).uniform(0.001, 0.08, len(sent_s))
    found = noticed(sent_s, sent_s + delay_s, set_by_s, set_at_s=30.0)
    assert found == (pytest.approx([30.0]) if seen else [])


def test_a_pause_and_messages_that_were_held_up_are_no_set_clock():
    sent_s = 0.1 * np.arange(1200)
    paused = sent_s[(sent_s < 20.0) | (sent_s > 27.0)]
    assert noticed(paused, paused + 0.01) == []
    # All that is sent within 4 s arrives at their end; most of it may be lost.
    held_up = np.where((sent_s > 40.0) & (sent_s < 44.0), 44.0, sent_s) + 0.01
    for keeps in (1, 7, 35):
        kept = (sent_s <= 40.0) | (sent_s >= 44.0) | (np.arange(len(sent_s)) % keeps == 1 % keeps)
        assert noticed(sent_s[kept], held_up[kept]) == []


@pytest.mark.parametrize("drift", [-5e-4, -5e-5, 5e-5, 5e-4])
def test_a_clock_that_drifted_for_hours_is_noticed_when_it_is_set(drift):
    received_s = 2.0 * np.arange(9000)
    sent_s = received_s * (1.0 + drift)
    found = noticed(sent_s, received_s, 0.6, set_at_s=sent_s[8000])
    assert found == [sent_s[8000]]


def test_a_clock_that_was_set_back_is_noticed_when_it_is_set_forward_later():
    sent_s = 0.1 * np.arange(800)
    shown_s = np.where(sent_s < 10.0, sent_s, sent_s - 60.0) + np.where(sent_s < 45.0, 0.0, 2.0)
    clock = SenderClock()
    found = [
        sent
        for sent, shown in zip(sent_s, shown_s, strict=True)
        if clock.was_set_forward(SENT_NS + round(shown * S_NS), round(sent * S_NS))
    ]
    assert found == pytest.approx([45.0])


def test_two_senders_with_different_clocks_are_reported_once_at_most():
    received_s = 0.05 * np.arange(4000)
    ahead_s = np.where(np.arange(4000) % 3 == 0, 4.0, 0.0)  # one sends half as often
    ahead_s[:1000] = 0.0
    found = noticed(received_s + ahead_s, received_s)
    assert len(found) == 1


def test_a_middleware_that_says_no_time_of_sending_says_nothing():
    clock = SenderClock()
    assert not clock.was_set_forward(0, 5)
    assert not clock.was_set_forward(SENT_NS, S_NS)
    assert not clock.was_set_forward(0, 2 * S_NS)
    assert clock.was_set_forward(SENT_NS + 3 * S_NS, 2 * S_NS)
