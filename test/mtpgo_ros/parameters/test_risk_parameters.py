# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node risk: checks, the parameter file, the page."""

import dataclasses
from pathlib import Path

import pytest
import yaml

from msg_adapters.inputs.ego_plans import PLANS
from msg_adapters.predictions.prediction_messages import PREDICTIONS
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.constant_velocity import ConstantVelocityNoise
from mtpgo_ros.parameters.risk_parameters import (
    PLAN_TYPES,
    PREDICTION_TYPES,
    RiskParameters,
    updated_risk,
)

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"plan_type": "spline"}, "plan_type is 'spline', expected one of"),
        ({"ego_length": 0.0}, "ego_length is 0.0, expected"),
        ({"occupancy_from": 3.0}, "occupancy_until is 2, expected at least occupancy_from, 3"),
        ({"occupancy_size": 1000.0, "occupancy_resolution": 0.1}, "10000 cells a side"),
        ({"plan_timeout": float("nan")}, "plan_timeout is nan"),
    ],
)
def test_values_that_make_no_sense_are_refused(values, words):
    with pytest.raises(ConfigurationError, match=words):
        updated_risk(RiskParameters(), values)


def test_names_that_are_not_parameters_of_the_node_are_ignored():
    found = updated_risk(RiskParameters(), {"use_sim_time": True, "after_plan": "stand"})
    assert found == RiskParameters(after_plan="stand")
    assert found.stands_after


def test_every_type_of_plan_and_of_predictions_has_an_adapter():
    assert set(PLAN_TYPES) == set(PLANS)
    assert set(PREDICTION_TYPES) == set(PREDICTIONS)


def test_the_description_names_what_is_assumed_of_a_missing_covariance():
    noise = ConstantVelocityNoise()
    field = RiskParameters.__dataclass_fields__["missing_covariance"]
    given = f"{noise.position_std_m:g} m and {noise.velocity_std_mps:g} m/s"
    assert given in field.metadata["description"]
    assert updated_risk(RiskParameters(), {"missing_covariance": "assumed"}).assumes_covariance


def test_the_parameter_file_has_the_defaults():
    given = yaml.safe_load((ROOT / "config" / "risk.yaml").read_text())
    defaults = {f.name: f.default for f in dataclasses.fields(RiskParameters)}
    assert given["/**"]["ros__parameters"] == defaults


def test_the_page_has_every_parameter_and_its_default():
    text = (ROOT / "docs" / "risk.md").read_text().partition("## Parameters")[2]
    for field in dataclasses.fields(RiskParameters):
        value = field.default
        written = str(value).lower() if isinstance(value, bool) else str(value)
        row = next(line for line in text.splitlines() if line.startswith(f"| `{field.name}` |"))
        assert row.split("|")[2].strip() == (f"`{written}`" if written else "empty"), field.name
        assert row.split("|")[3].strip() == field.metadata["description"]
