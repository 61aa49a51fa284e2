# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Best effort until messages are lost or do not come; the other choice once for each silence."""

from mtpgo_ros.node.reliability_choice import ReliabilityChoice


def changes(choice, times_s, **given):
    values = {"possible": True, "matched": True, **given}
    return [now_s for now_s in times_s if choice.update(now_s=now_s, **values)]


def test_a_silence_changes_the_choice_once():
    choice = ReliabilityChoice(0.0)
    assert changes(choice, range(100)) == [4]
    assert choice.reliable
    assert not choice.received(10**6, 100.0)
    assert changes(choice, range(100, 200)) == [102]
    assert not choice.reliable


def test_lost_messages_make_it_reliable():
    choice = ReliabilityChoice(0.0)
    choice.received(100, 1.0)
    choice.lost(4)
    assert changes(choice, [1.1]) == []
    choice.lost(1)
    assert changes(choice, [1.2, 1.3]) == [1.2]
    assert choice.reliable


def test_a_best_effort_publisher_must_be_heard():
    choice = ReliabilityChoice(0.0)
    choice.lost(5)
    assert changes(choice, [0.1]) == [0.1]
    assert changes(choice, [0.2], possible=False) == [0.2]
    choice.lost(5)
    assert changes(choice, range(1, 50), possible=False) == []


def test_without_a_publisher_silence_means_nothing():
    choice = ReliabilityChoice(0.0)
    assert changes(choice, range(50), matched=False) == []
    assert changes(choice, range(50, 54)) == [53]


def test_a_small_message_after_a_silence_says_that_it_was_a_pause():
    choice = ReliabilityChoice(0.0)
    assert changes(choice, range(10)) == [4]
    assert choice.received(100, 10.0)
    assert not choice.reliable
    choice.lost(5)
    assert changes(choice, [10.1]) == [10.1]
    assert not choice.received(100, 10.2)
    assert choice.reliable


def test_a_slow_stream_is_not_taken_for_a_silence():
    choice, changed = ReliabilityChoice(0.0), []
    for second in range(0, 40, 2):
        choice.received(100, float(second))
        changed += changes(choice, [second + 0.1 * k for k in range(1, 20)])
    assert changed == [1.1]  # before anything is known about its rate
    assert not choice.reliable
    assert changes(choice, range(38, 50)) == [45]
