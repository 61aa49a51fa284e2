# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared fixtures of the core's tests."""

import sys
from pathlib import Path

import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))
from core_helpers import write_model


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def model_file(tmp_path_factory):
    """A model file of second order, three modes and five steps."""
    path = tmp_path_factory.mktemp("model") / "straight.pt"
    write_model(path)
    return path
