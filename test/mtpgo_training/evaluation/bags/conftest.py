# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The shipped model, a recording, and a bag of the model's predictions of it."""

import pytest
from recorded_bags import play
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner, find_model


@pytest.fixture(scope="package")
def runner():
    return ModelRunner.load(find_model("default"))


@pytest.fixture(scope="package")
def recording():
    return braking_cars(tracks=8, seconds=8.0)


@pytest.fixture(scope="package")
def bag(recording, runner, tmp_path_factory):
    return play(recording, runner, tmp_path_factory.mktemp("bag") / "online")
