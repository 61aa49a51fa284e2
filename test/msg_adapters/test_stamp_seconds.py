# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps with microseconds or milliseconds in the field of nanoseconds, and others like them."""

import pytest

from msg_adapters.stamp_seconds import StampPace, StampSeconds

S_NS = 10**9
EPOCH_NS = 1_700_000_000 * S_NS


def of_another_unit(stamps_s, logged_s=None):
    followed = StampSeconds()
    for stamp_s, log_s in zip(stamps_s, logged_s or stamps_s, strict=True):
        followed.add(EPOCH_NS + round(stamp_s * S_NS), EPOCH_NS + round(log_s * S_NS))
    return followed.are_of_another_unit


def divided(time_s, factor):
    return int(time_s) + time_s % 1 / factor


TEN_HZ = [i / 10 for i in range(40)]


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_parts_of_seconds_in_another_unit_are_found(factor):
    assert of_another_unit([divided(t, factor) for t in TEN_HZ], TEN_HZ)


@pytest.mark.parametrize(
    ("stamps_s", "logged_s"),
    [
        (TEN_HZ, TEN_HZ),
        ([float(int(t)) for t in TEN_HZ], TEN_HZ),  # no parts at all
        ([divided(t, 1e3) for t in TEN_HZ[:9]], TEN_HZ[:9]),  # few
        ([t / 1e7 for t in TEN_HZ], TEN_HZ),  # another clock, all in one second
        # Two sensors that measure at full seconds, heard 30 ms apart.
        ([i // 2 + i % 2 * 1e-5 for i in range(80)], [i // 2 + i % 2 * 0.03 for i in range(80)]),
        ([divided(t, 1e3) for t in TEN_HZ], [0.0] * 40),  # recorded without times
    ],
)
def test_other_stamps_are_left_alone(stamps_s, logged_s):
    assert not of_another_unit(stamps_s, logged_s)


@pytest.mark.parametrize(
    ("pace", "clock_s", "slow"),
    [
        (1e-3, TEN_HZ, True),
        (0.0, TEN_HZ, True),
        (0.02, TEN_HZ, False),  # a bag that is played slowly
        (1.0, TEN_HZ, False),
        (1e-3, [t / 2 for t in TEN_HZ], False),  # no three seconds
        (1e-3, [10 * t for t in range(9)], False),  # few messages in three seconds
        (1e-3, [0.0] * 40, False),  # no clock, as before the first message on /clock
    ],
)
def test_stamps_that_hardly_advance(pace, clock_s, slow):
    followed = StampPace()
    for time_s in clock_s:
        clock_ns = round((5.0 + time_s) * S_NS) if any(clock_s) else 0
        followed.add(EPOCH_NS + round(pace * time_s * S_NS), clock_ns)
    assert followed.is_slow == slow


def test_stamps_that_advance_again_are_no_longer_slow():
    followed = StampPace()
    for step in range(80):
        advanced_s = 1e-4 * step if step < 40 else 0.1 * (step - 40)
        followed.add(EPOCH_NS + round(advanced_s * S_NS), EPOCH_NS + step * S_NS // 10)
        if step == 40:
            assert followed.is_slow
    assert not followed.is_slow
