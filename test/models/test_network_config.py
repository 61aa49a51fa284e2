# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options that all networks have: their limits, round trip and derived sizes."""

import json

import pytest

from models import ModelConfig
from models.network_config import NetworkConfig
from mtpgo_core.errors import ConfigurationError


def test_round_trip_through_json():
    config = NetworkConfig(feature_size=11, horizon_steps=10, static_features=True, dt_s=0.1)
    assert NetworkConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config
    assert list(config.to_dict()) == NetworkConfig.names()


@pytest.mark.parametrize(
    ("choices", "sentence"),
    [
        ({"feature_size": 7}, "model.feature_size is 7, expected at least 8"),
        ({"history_steps": 0}, "model.history_steps is 0, expected at least 1"),
        ({"dt_s": float("inf")}, "model.dt_s is inf, expected more than 0 and finite"),
        ({"covariance_scale": 0.0}, "model.covariance_scale is 0.0, expected more than 0"),
        ({"observation_std_m": -0.1}, "model.observation_std_m is -0.1, expected at least 0"),
        ({"hidden": "64"}, "model.hidden is '64', expected int"),
    ],
)
def test_a_value_outside_its_limits_is_named(choices, sentence):
    with pytest.raises(ConfigurationError) as error:
        NetworkConfig(**choices)
    assert sentence in str(error.value)


@pytest.mark.parametrize("kind", [NetworkConfig, ModelConfig])
def test_static_features_need_classes(kind):
    with pytest.raises(ConfigurationError, match="static_features is True and static_size 0"):
        kind(static_features=True, static_size=0)


def test_there_may_be_no_classes_if_they_are_no_input():
    assert NetworkConfig(static_size=0).static_size == 0


def test_positions_are_predicted_and_observed_unless_a_network_predicts_more():
    config = NetworkConfig(observation_std_m=0.3)
    assert (config.state_size, config.observation_std) == (2, [0.3, 0.3])
