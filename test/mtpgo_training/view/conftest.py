# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A scene of two vehicles whose predictions come true."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction

from mtpgo_training.view.view_scene import view_scene

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def recording():
    return make_recording()


@pytest.fixture(scope="session")
def scene(recording):
    """12 s, predictions every 0.2 s up to 10 s."""
    predictions = [perfect_prediction(recording, frame) for frame in range(0, 101, 2)]
    lane = np.array([[0.0, -12.0], [60.0, -12.0], [120.0, -12.0]])
    observed = dataclasses.replace(recording, lanes=(lane,))
    return view_scene(observed, predictions, name="made", model="perfect")
