# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training step keeps its advantage over a straightforward implementation, and its memory."""

import pytest

from mtpgo_training.benchmark.training import PHASES, measure

NOT_YET = pytest.mark.xfail(reason="2.2 is asked for, about 2.1 is reached in this phase")


@pytest.mark.parametrize(
    "phase", [pytest.param(p, marks=NOT_YET) if p == "NLL" else p for p in PHASES]
)
def test_a_training_step_keeps_its_ratio(phase: str) -> None:
    """As it trains on two cores by default: two processes with a thread each."""
    row = measure(phase, scenes=128, threads=2, rounds=5)[0]
    assert row.processes == 2
    assert row.ratio >= 2.2, row
    assert row.memory_share <= 0.5, row
