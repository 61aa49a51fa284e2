# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training step keeps its advantage over a straightforward implementation, and its memory."""

from collections.abc import Iterator

import pytest
import torch

from mtpgo_training.benchmark.training import PHASES, measure


@pytest.fixture
def threads() -> Iterator[int]:
    yield 2
    torch.set_num_threads(1)


@pytest.mark.parametrize("phase", PHASES)
def test_a_training_step_keeps_its_ratio(phase: str, threads: int) -> None:
    row = measure(phase, scenes=128, threads=threads, rounds=5)
    assert row.ratio >= 2.2, row
    assert row.memory_share <= 0.5, row
