# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the speed tests: thread settings, the reference model, paired measurements.

The speed tests check ratios within one run, never absolute times, because machines differ and run
other programs. They are not part of `make test`; `make benchmark` runs them.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mtpgo_training.benchmark.measurement.benchmark_model import model_file
from mtpgo_training.training.torch_process import prepare_process

InTurns = Callable[..., float]


@pytest.fixture(scope="session", autouse=True)
def quiet_process() -> None:
    prepare_process(1)


@pytest.fixture(scope="session")
def reference_file():
    with model_file("reference") as path:
        yield path


@pytest.fixture
def in_turns(benchmark: Any) -> InTurns:
    """Call two functions alternately; return the second's median time over the first's."""

    def measure(first: Callable[[], Any], second: Callable[[], Any], rounds: int) -> float:
        other_s: list[float] = []

        def other() -> None:
            begin = time.perf_counter()
            second()
            other_s.append(time.perf_counter() - begin)

        benchmark.pedantic(first, setup=other, rounds=rounds, warmup_rounds=2)
        ratio = float(np.median(other_s[2:])) / benchmark.stats.stats.median
        benchmark.extra_info["ratio"] = round(ratio, 2)
        return ratio

    return measure
