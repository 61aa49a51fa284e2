# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared fixtures of the ROS tests."""

import signal
import sys
import warnings
from pathlib import Path

import pytest
import torch
from rclpy.node import Node

sys.path.insert(0, str(Path(__file__).parent))
from ros_helpers import Bench, Process, end, init
from tiny_model import write_tiny_model


@pytest.fixture(scope="session", autouse=True)
def _ros():
    torch.set_num_threads(1)
    init()


@pytest.fixture(scope="session")
def models(tmp_path_factory):
    """Model files: slow takes 0.1 s at least, stuck minutes, poison is NaN if agents are fast."""
    folder = tmp_path_factory.mktemp("models")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return {
            "quick": write_tiny_model(folder / "quick.pt"),
            "slow": write_tiny_model(folder / "slow.pt", work=150),
            "stuck": write_tiny_model(folder / "stuck.pt", work=100_000),
            "lanes": write_tiny_model(folder / "lanes.pt", context="lanes"),
            "wrong": write_tiny_model(folder / "wrong.pt", drift_mps=3.0),
            "poison": write_tiny_model(folder / "poison.pt", poison=True),
        }


@pytest.fixture
def bench(models):
    """Return a function that starts test benches; all are closed at the end."""
    made = []

    def make(model="quick", *, started=True, patient=True, **parameters):
        made.append(Bench(models.get(model, model), **parameters))
        if started:
            made[-1].start()
        if started and patient:
            made[-1].be_patient()
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def process():
    """Return a function that starts processes; those still running at the end are ended."""
    made = []

    def make(module, *arguments, **options):
        made.append(Process(module, *arguments, **options))
        return made[-1]

    yield make
    for one in made:
        end(one.popen)
        one.finish()


@pytest.fixture
def signals():
    """For tests that change what signals do: it is as before afterwards."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def peer():
    """A node to communicate with processes."""
    node = Node("peer")
    yield node
    node.destroy_node()
