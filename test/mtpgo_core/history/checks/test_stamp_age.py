# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Observations that are old when they come, by a clock that shows their time."""

import pytest

from mtpgo_core.history.checks.stamp_age import StampAge


def problem(*ages_s, messages=40):
    age = StampAge()
    for k in range(messages):
        stamp_ns = 10**18 + k * 10**8
        age.add(stamp_ns, stamp_ns + round(ages_s[k % len(ages_s)] * 1e9))
    return age.problem


@pytest.mark.parametrize(("ages_s", "said"), [((2.1,), "2.1 s old"), ((0.7, 3.0), "0.7 s old")])
def test_old_observations(ages_s, said):
    assert f"the objects are {said} when they come" in problem(*ages_s)


@pytest.mark.parametrize("ages_s", [(0.1,), (0.1, 3.0), (-1.0,), (1e6,), (1e9,)])
def test_others(ages_s):
    assert problem(*ages_s) == ""


def test_a_few_messages_or_no_clock_give_no_verdict():
    assert problem(2.0, messages=10) == ""
    age = StampAge()
    for _ in range(40):
        age.add(10**18, 0)
    assert age.problem == ""
