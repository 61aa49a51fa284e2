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
