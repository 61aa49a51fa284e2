# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The shipped model, a recording, and a bag of the model's predictions of it."""

import dataclasses

import pytest
from recorded_bags import play
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner, find_model


@pytest.fixture(scope="package")
def runner():
    return ModelRunner.load(find_model("default"))


@pytest.fixture(scope="package")
def recording():
    # As precise as files are, so that a bag and files say the same.
    made = braking_cars(tracks=8, seconds=8.0)
    rounded = {name: getattr(made, name).round(4) for name in ("position", "velocity")}
    return dataclasses.replace(made, **rounded)


@pytest.fixture(scope="package")
def bag(recording, runner, tmp_path_factory):
    return play(recording, runner, tmp_path_factory.mktemp("bag") / "online")
