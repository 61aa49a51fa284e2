# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The short form of ``make fuzz``: a few changed inputs of each target, the same in each run."""

import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from fuzz_target import HANG_S, all_targets, mutated_text, processor_time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_fuzz import State

INPUTS = 40
TARGETS = all_targets()
LONGEST_S = 10.0 * HANG_S
"""Most processor time of an input (s). A processor that is shared needs several times that of one
that is not: what takes longer than HANG_S, `make fuzz` finds on a machine of its own."""


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
        assert processor_time(target, target.mutated(seed, random.Random(number))) <= LONGEST_S

    check()


@pytest.mark.parametrize("name", TARGETS)
def test_arbitrary_bytes_are_read_or_refused(name):
    target = TARGETS[name]

    @settings(max_examples=INPUTS // 2, deadline=None, derandomize=True, database=None)
    @given(st.binary(max_size=300))
    def check(data):
        target.check(data)

    check()


def test_most_changed_texts_are_texts():
    draw, text = random.Random(0), b"a: b\n17: car\nc: bus\n"
    changed = {mutated_text(text, draw) for _ in range(200)}
    assert len(changed) > 100
    readable = [one for one in changed if "\ufffd" not in one.decode(errors="replace")]
    assert len(readable) > 0.95 * len(changed)


def test_the_input_of_a_process_that_ended_is_known(tmp_path):
    state = State.created(tmp_path / "state")
    command = "import os, pathlib, run_fuzz, sys\n"
    command += "run_fuzz.State(pathlib.Path(sys.argv[1])).note(7, 3, b'bad'); os.abort()"
    ended = subprocess.run(
        [sys.executable, "-c", command, str(state.path)], cwd=Path(__file__).parent, check=False
    )
    assert ended.returncode == -signal.SIGABRT
    assert state.read() == (7, 3, b"bad")
