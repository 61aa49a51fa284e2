# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Guards the exported model's advantage over a straightforward implementation.

Ratios of medians taken in turns within one run, never absolute times: machines differ, and are
busy with other things. Not part of `make test`; `make benchmark` runs it.
"""

import pytest
import torch

from mtpgo_training.benchmark.latency import gemm_gflops, measure
from mtpgo_training.process import prepare_process


@pytest.fixture(scope="module")
def peak_gflops() -> float:
    prepare_process(1)
    return gemm_gflops()


@pytest.mark.parametrize(("agents", "least"), [(8, 15.0), (16, 11.0), (32, 8.0), (64, 7.0)])
def test_one_prediction_keeps_its_ratio(agents: int, least: float, peak_gflops: float) -> None:
    row = measure(agents, seconds=8.0, peak_gflops=peak_gflops)
    assert torch.get_num_threads() == 1
    assert row.ratio >= least, row
