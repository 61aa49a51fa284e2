# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Results that are kept: read back unchanged, made again where something differs, never run."""

import os
from dataclasses import dataclass

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.parallel.kept_results import kept_or_made


@dataclass
class Kept:
    """A result."""

    rows: np.ndarray
    share: np.float64


class Odd:
    """What runs a command when it is read."""

    def __reduce__(self):
        return os.getcwd, ()


def made(calls):
    calls.append(1)
    return Kept(np.array([(1, 2.5)], dtype=[("a", "u1"), ("b", "f4")]), np.float64(0.5))


def test_a_result_is_made_once_and_read_back(tmp_path):
    calls = []
    for seed in (1, 1, 2):
        found = kept_or_made(tmp_path, {"seed": seed}, lambda: made(calls), (Kept,), made)
        assert found.rows["b"].tolist() == [2.5]
        assert found.share == 0.5
    assert len(calls) == 2
    kept_or_made(None, {"seed": 1}, lambda: made(calls), (Kept,), made)
    assert len(calls) == 3


def test_what_is_no_result_is_not_run(tmp_path):
    with pytest.raises(ConfigurationError, match=r"posix\.getcwd, which is none of ours"):
        kept_or_made(tmp_path, {}, Odd, (Kept,), made)
