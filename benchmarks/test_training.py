# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training step is faster and uses less memory than a straightforward implementation."""

import pytest

from mtpgo_training.benchmark.training_benchmark import PHASES, measure


@pytest.mark.parametrize("phase", PHASES)
def test_a_training_step_keeps_its_ratio(phase: str) -> None:
    """The default on two cores: two processes with one thread each."""
    row = measure(phase, scenes=128, threads=2, rounds=7)[0]
    assert row.processes == 2
    assert row.ratio >= 2.2, row
    assert row.memory_share <= 0.5, row
