# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that do training steps on command."""

import functools
import mmap

import pytest
import torch
from torch import nn

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.benchmark import training_benchmark as training
from mtpgo_training.benchmark.measurement.step_workers import Team, memory_mb, sum_gradients


def test_processes_that_share_a_batch_do_the_same_steps():
    """Summed over two processes, losses and gradients are those of one with the whole batch."""
    step = training.make_step("ours", "EWTA", 5)
    alone = [step() for _ in range(2)]
    with Team(functools.partial(training.make_step, "ours", "EWTA", 5), 2, 1) as team:
        shared = [team.step()[1] for _ in range(2)]
        assert 0.0 < team.growth_mb() < 2000.0
    assert shared == pytest.approx(alone, rel=1e-5)
    assert alone[1] != pytest.approx(alone[0], rel=1e-5)


def test_a_failure_in_a_process_is_one_sentence():
    with pytest.raises(ConfigurationError, match="the training benchmark failed: KeyError"):
        Team(functools.partial(training.make_step, "ours", "no phase", 1), 1, 1)


def test_the_sum_over_one_process_is_its_own_gradient(tmp_path):
    torch.distributed.init_process_group(
        "gloo", init_method=f"file://{tmp_path / 'store'}", rank=0, world_size=1
    )
    try:
        model = nn.Sequential(nn.Linear(2, 3), nn.Linear(3, 1))
        model[0](torch.ones(1, 2)).sum().backward()
        expected = [p.grad.clone() for p in model[0].parameters()]
        sum_gradients(model)
    finally:
        torch.distributed.destroy_process_group()
    for parameter, grad in zip(model[0].parameters(), expected, strict=True):
        torch.testing.assert_close(parameter.grad, grad)
    assert all(p.grad is None for p in model[1].parameters())  # not in the loss


def test_the_largest_memory_remains_when_memory_is_freed():
    """Linux updates both numbers with a delay of some pages per thread."""
    # Not by malloc, which would keep the memory where a training before has told it to.
    held = mmap.mmap(-1, 64 * 2**20)
    held.write(bytes(len(held)))
    largest = memory_mb("VmHWM")
    assert memory_mb("VmRSS") <= largest + 2.0
    held.close()
    assert memory_mb("VmHWM") == pytest.approx(largest, abs=2.0)
    assert memory_mb("VmRSS") < largest - 32.0
