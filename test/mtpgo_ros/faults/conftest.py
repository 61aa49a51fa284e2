# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the fault tests: predictor processes under faults, seen from outside."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from fault_harness import PATIENT_S, FaultHarness


@pytest.fixture(scope="module")
def start_predictor(models):
    """Return a function that starts predictor processes; all are ended after the module."""
    made = []

    def start(model="quick", **options):
        made.append(FaultHarness(models.get(model, model), **options))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture(scope="session")
def node(models):
    """A predictor of point clouds, shared by the faults of values, identities and layouts."""
    options = {"own_diagnostics": True, "input_timeout": PATIENT_S}
    one = FaultHarness(models["quick"], use_tracker_covariance=True, **options)
    yield one
    one.close()


@pytest.fixture(scope="session")
def marker_node(models):
    """A predictor of markers, shared in the same way."""
    options = {"own_diagnostics": True, "input_timeout": PATIENT_S}
    one = FaultHarness(models["quick"], kind="markers", **options)
    yield one
    one.close()
