# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Status of messages in a stream, message by message."""

import pytest

from mtpgo_core.history.stream_guard import MessageStatus, StreamGuard

MS = 1_000_000
OK, RESET = MessageStatus.CONTINUES, MessageStatus.CLOCK_RESET
UNEXPECTED, NEW = MessageStatus.UNEXPECTED_FRAME, MessageStatus.NEW_FRAME


@pytest.fixture
def guard():
    """A guard that has seen one message at 10 s in the frame map; it keeps 3 s."""
    guard = StreamGuard(keep_ns=3000 * MS)
    assert guard.classify(10_000 * MS, "map") is OK
    return guard


def statuses(guard, *messages):
    return [guard.classify(stamp_ms * MS, frame) for stamp_ms, frame in messages]


def test_two_late_messages_are_accidents_the_third_is_a_reset(guard):
    late = [(9499, "map"), (9498, "map"), (9497, "map")]
    assert statuses(guard, *late[:2], (10_100, "map")) == [OK, OK, OK]
    assert guard.newest_ns == 10_100 * MS
    assert statuses(guard, *late) == [OK, OK, RESET]
    assert guard.newest_ns == 9497 * MS


def test_half_a_second_is_not_late(guard):
    assert statuses(guard, *[(9500, "map")] * 5) == [OK] * 5


def test_a_message_older_than_the_history_is_a_reset_immediately(guard):
    assert statuses(guard, (7000, "map")) == [OK]
    assert statuses(guard, (6999, "map")) == [RESET]


def test_three_messages_in_one_other_frame_are_a_new_frame(guard):
    assert statuses(guard, *[(10_100 + k, "odom") for k in range(4)]) == [
        UNEXPECTED,
        UNEXPECTED,
        NEW,
        OK,
    ]
    assert (guard.frame_id, guard.newest_ns) == ("odom", 10_103 * MS)


def test_the_count_starts_again_with_another_frame_and_with_the_expected_one(guard):
    frames = ["odom", "odom", "base_link", "odom", "odom", "map", "odom", "odom"]
    found = statuses(guard, *[(10_100 + k, frame) for k, frame in enumerate(frames)])
    assert found == [UNEXPECTED] * 5 + [OK] + [UNEXPECTED] * 2


def test_messages_without_objects_do_not_hinder_a_new_frame(guard):
    """Of a road that is empty now and then, or of a second publisher that sees no objects."""
    frames = ["odom", None, "odom", None, "odom", None, "odom"]
    found = statuses(guard, *[(10_100 + k, frame) for k, frame in enumerate(frames)])
    assert found == [UNEXPECTED, OK, UNEXPECTED, OK, NEW, OK, OK]


def test_an_unexpected_message_does_not_move_the_time(guard):
    assert statuses(guard, (20_000, "odom")) == [UNEXPECTED]
    assert guard.newest_ns == 10_000 * MS


def test_messages_without_objects_have_no_frame(guard):
    assert statuses(guard, (10_100, None), (10_200, "map")) == [OK, OK]
    empty = StreamGuard(keep_ns=1000 * MS)
    assert statuses(empty, (5, None), (6, "odom")) == [OK, OK]
    assert empty.frame_id == "odom"


def test_a_cleared_guard_accepts_anything(guard):
    guard.clear()
    assert (guard.newest_ns, guard.frame_id) == (None, None)
    assert statuses(guard, (1, "odom")) == [OK]


def two_clocks(guard, behind_ms, late_ones, cycles):
    """Return how often the clock was reset by messages from behind among those of 5 Hz."""
    found = []
    for cycle in range(cycles):
        newest_ms = 10_200 + 200 * cycle
        behind = [(newest_ms - behind_ms + 200 * k // late_ones, "map") for k in range(late_ones)]
        found += statuses(guard, (newest_ms, "map"), *behind)
    return found.count(RESET)


@pytest.mark.parametrize(
    ("behind_ms", "late_ones", "resets"), [(5000, 1, 1), (5000, 3, 2), (2000, 4, 1), (800, 6, 2)]
)
def test_two_publishers_with_different_clocks_do_not_clear_each_other_forever(
    guard, behind_ms, late_ones, resets
):
    assert two_clocks(guard, behind_ms, late_ones, cycles=50) == resets
    assert guard.newest_ns == 20_000 * MS


def test_after_two_clocks_the_later_one_may_end(guard):
    two_clocks(guard, 5000, 3, cycles=50)
    alone = statuses(guard, *[(15_100 + 100 * k, "map") for k in range(10)])
    assert alone.count(RESET) == 1
    assert guard.newest_ns == 16_000 * MS


def test_a_bag_that_loops_is_believed_at_once_each_time(guard):
    for _ in range(5):
        assert statuses(guard, (1000, "map"), (1100, "map"), (9900, "map"), (10_000, "map")) == [
            RESET,
            OK,
            OK,
            OK,
        ]


def test_the_doubt_ends_when_nothing_comes_from_behind(guard):
    two_clocks(guard, 5000, 1, cycles=5)
    assert statuses(guard, (71_000, "map"), (5000, "map")) == [OK, OK]
    assert statuses(guard, (72_000, "map"), (133_000, "map"), (5000, "map")) == [OK, OK, RESET]
