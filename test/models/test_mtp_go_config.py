# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of MTP-GO: round trip, and the errors of wrong values."""

import json

import pytest

from models import ModelConfig
from mtpgo_core.errors import ConfigurationError


def test_round_trip_through_json():
    config = ModelConfig(order=1, layer="gcn", static_features=True, dt_s=0.1)
    assert ModelConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("layer", "gatt", "layer is 'gatt', expected one of 'graphconv', 'gcn', 'gat', 'gat+'"),
        ("order", 3, "order is 3, expected one of 1, 2"),
        ("integrator", "rk5", "integrator is 'rk5', expected one of 'euler', 'heun', 'rk4'"),
        ("noise_input", "", "noise_input is '', expected one of 'velocity', 'integrated'"),
        ("initial_covariance", "x", "expected one of 'learned', 'configured'"),
        (
            "static_inputs",
            "encoder",
            "is 'encoder', expected one of 'motion', 'all'",
        ),
        ("trail_branches", -1, "trail_branches is -1, expected at least 0"),
        ("hold_standing", 1, "hold_standing is 1, expected bool"),
        ("stay_bias", -0.1, "stay_bias is -0.1, expected at least 0"),
        ("modes", 0, "modes is 0, expected 1 to 64"),
        ("feature_size", 7, "feature_size is 7, expected at least 8"),
        ("hidden", 64.0, "hidden is 64.0, expected int"),
        ("modes", True, "modes is True, expected int"),
        ("tied", 1, "tied is 1, expected bool"),
        ("dt_s", 0.0, "dt_s is 0.0, expected more than 0 and finite"),
        ("initial_std_m", float("nan"), "initial_std_m is nan, expected more than 0 and finite"),
        ("ode", False, "expected ekf=False without a motion model"),
        ("learning_rate", 1, "unknown field 'learning_rate'"),
    ],
)
def test_a_bad_value_is_named(field, value, sentence):
    with pytest.raises(ConfigurationError, match="expected") as error:
        ModelConfig.from_dict({field: value})
    assert sentence in str(error.value)


def test_an_integer_is_accepted_for_a_float():
    assert ModelConfig(dt_s=1).dt_s == 1
