# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps with microseconds or milliseconds in the field of nanoseconds, and others like them."""

import pytest

from msg_adapters.stamp_seconds import StampSeconds

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
