# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The short form of ``make fuzz``: a few changed inputs of each target, the same in each run."""

import random

import pytest
from fuzz_target import HANG_S, all_targets, processor_time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

INPUTS = 40
TARGETS = all_targets()


@pytest.mark.parametrize("name", TARGETS)
def test_the_valid_inputs_are_accepted(name):
    seeds = TARGETS[name].seeds()
    assert seeds
    for seed in seeds:
        TARGETS[name].run(seed)


@pytest.mark.parametrize("name", TARGETS)
def test_changed_inputs_are_read_or_refused(name):
    target = TARGETS[name]
    seeds = list(target.seeds())
    target.check(seeds[0])

    @settings(max_examples=INPUTS, deadline=None, derandomize=True, database=None,
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(st.sampled_from(seeds), st.integers(0, 2**32 - 1))
    def check(seed, number):
        assert processor_time(target, target.mutated(seed, random.Random(number))) <= HANG_S

    check()


@pytest.mark.parametrize("name", TARGETS)
def test_arbitrary_bytes_are_read_or_refused(name):
    target = TARGETS[name]

    @settings(max_examples=INPUTS // 2, deadline=None, derandomize=True, database=None)
    @given(st.binary(max_size=300))
    def check(data):
        target.check(data)

    check()
