# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Failing steps of the conversion benchmark."""

import pytest

from mtpgo_training.benchmark.conversion_benchmark import timed


def test_a_step_that_fails_is_quoted():
    with pytest.raises(Exception, match="'convert' ended with status 2: mtpgo convert: the"):
        timed("convert", ["-m", "mtpgo_training.cli", "convert", "x", "y"], 1.0)
