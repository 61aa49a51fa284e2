# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the process: threads, denormal numbers and the cache of casts."""

import pytest
import torch

from mtpgo_training.training.torch_process import prepare_process


@pytest.fixture(autouse=True)
def restored():
    """Leave the process as it was; the number of threads is restored for every test."""
    cached = torch.is_autocast_cache_enabled()
    yield
    torch.set_autocast_cache_enabled(cached)
    torch.set_flush_denormal(False)


def test_denormal_numbers_are_zero():
    torch.set_flush_denormal(False)
    smallest = torch.tensor([1e-30], dtype=torch.float32)
    if not torch.set_flush_denormal(True):
        pytest.skip("this processor cannot flush denormal numbers")
    torch.set_flush_denormal(False)
    assert (smallest * 1e-10).item() > 0.0
    prepare_process(0)
    assert (smallest * 1e-10).item() == 0.0


def test_the_threads_are_set_unless_they_are_left_to_torch():
    prepare_process(1)
    assert torch.get_num_threads() == 1
    prepare_process(0)
    assert torch.get_num_threads() == 1


def test_casts_of_weights_are_not_cached():
    torch.set_autocast_cache_enabled(True)
    prepare_process(0)
    assert not torch.is_autocast_cache_enabled()
