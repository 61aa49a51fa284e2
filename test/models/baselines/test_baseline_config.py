# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of the baselines: round trip, and the errors of wrong values."""

import json

import pytest

from models.baselines import GraphConfig, GridConfig, RecurrentConfig
from mtpgo_core.errors import ConfigurationError


@pytest.mark.parametrize(
    "config", [RecurrentConfig(modes=2), GridConfig(rows=7), GraphConfig(layer="gcn")]
)
def test_round_trip_through_json(config):
    assert type(config).from_dict(json.loads(json.dumps(config.to_dict()))) == config


@pytest.mark.parametrize(
    ("kind", "field", "value", "sentence"),
    [
        (RecurrentConfig, "rows", 9, "the unknown field 'rows', expected feature_size, "),
        (RecurrentConfig, "embedding", 0, "embedding is 0, expected at least 1"),
        (
            RecurrentConfig,
            "observation_std_m",
            -1.0,
            "observation_std_m is -1.0, expected at least 0",
        ),
        (GridConfig, "rows", 4, "rows is 4, expected at least 5"),
        (GridConfig, "columns", 2.0, "columns is 2.0, expected int"),
        (
            GridConfig,
            "cell_length_m",
            0.0,
            "cell_length_m is 0.0, expected more than 0 and finite",
        ),
        (GridConfig, "bandwidth_m", 9.0, "the unknown field 'bandwidth_m'"),
        (GraphConfig, "layer", "mlp", "layer is 'mlp', expected one of 'graphconv', 'gcn'"),
        (GraphConfig, "gnn_layers", 0, "gnn_layers is 0, expected at least 1"),
    ],
)
def test_a_bad_option_is_one_sentence(kind, field, value, sentence):
    with pytest.raises(ConfigurationError, match="expected") as error:
        kind.from_dict({field: value})
    assert sentence in str(error.value)


def test_baselines_predict_positions():
    assert RecurrentConfig().state_size == 2
