# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The learning-rate range test: the suggestion by hand, and on a network."""

import math

import pytest
import torch
from tiny_run import new_run
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.networks import weights_hash
from mtpgo_training.training.trial.learning_rate_range import (
    FIRST,
    HIGHEST,
    LOWEST,
    RangeTest,
    learning_rate_range_test,
)


def test_the_rate_of_the_steepest_fall():
    rates = tuple(LOWEST * 10**k for k in range(20))
    losses = [5.0] * 13 + [4.9, 4.0, 3.9, 3.8, 3.7, 3.7, 9.0]
    # Central differences are largest at the place between 5.0, 4.9 and 4.0, 3.9: index 13 or 14.
    assert RangeTest(rates, tuple(losses)).suggestion in rates[13:15]


@pytest.mark.parametrize("losses", [(), (1.0,), (1.0,) * 30, tuple(map(float, range(30)))])
def test_no_suggestion_is_one_sentence(losses):
    rates = tuple(1e-8 * 2**k for k in range(len(losses)))
    with pytest.raises(ConfigurationError, match="found none at which the loss falls"):
        _ = RangeTest(rates, losses).suggestion


def test_on_a_network_whose_weights_do_not_change():
    run = new_run()
    cars = [
        NamedRecording("x", braking_cars(f"0{k}", seed=k, tracks=4, seconds=4)) for k in (1, 2)
    ]
    scenes = prepare_scenes(run.config, Splits((cars[0],), (cars[1],), ()), 5, progress=False)
    before = weights_hash(run.model)
    found = learning_rate_range_test(run, scenes, steps=60)
    assert weights_hash(run.model) == before
    assert run.state.step == 0
    assert found.rates[0] == LOWEST
    assert len(found.rates) > FIRST
    assert LOWEST < found.suggestion < HIGHEST
    assert all(math.isfinite(loss) for loss in found.losses)
    torch.manual_seed(9)
    assert learning_rate_range_test(run, scenes, steps=60).rates == found.rates
    assert found.to_csv().count("\n") == len(found.rates) + 1
