# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The groups of a calibration, its checks, and its way through the task description."""

import dataclasses
import json

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_core.task.calibration import (
    CLASS_GROUPS,
    GROUPS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
    calibration_groups,
)
from mtpgo_core.task.task_description import TaskDescription


def calibration(*factors):
    groups = (GroupCalibration(name=name, factors=factors) for name in GROUPS)
    return Calibration(tuple(groups), (CalibrationSite("a", 3),), left_out=True)


def test_groups_are_of_class_and_motion():
    classes = np.array([AgentClass.VAN, AgentClass.BICYCLE, AgentClass.PEDESTRIAN, 0, 1, 7])
    nan = np.nan
    velocity = np.array([[0.0, 3.0], [0.3, 0.3], [0.6, 0.0], [-9.0, 0.0], [nan, nan], [0.5, 0.0]])
    names = [GROUPS[i] for i in calibration_groups(classes.astype(np.uint8), velocity)]
    assert names == [
        "vehicle_moving",
        "two_wheeler_standing",
        "pedestrian_moving",
        "any_moving",
        "vehicle_moving",
        "pedestrian_standing",
    ]


def test_every_class_is_in_one_class_group():
    members = [member for group in CLASS_GROUPS.values() for member in group]
    assert sorted(members) == sorted(AgentClass)


def test_factors_that_decrease_are_refused():
    with pytest.raises(ConfigurationError, match=r"fall from 2 to 1\.5 at step 3, expected"):
        GroupCalibration(factors=(1.0, 2.0, 1.5))
    assert GroupCalibration(factors=(1.0, 2.0, 2.0)).factors == (1.0, 2.0, 2.0)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"factors": (0.0,)}, "calibration.factors is 0.0, expected 0.1 to 30"),
        ({"factors": (float("nan"),)}, "calibration.factors is nan"),
        ({"temperature": 9.0}, "calibration.temperature is 9.0, expected 0.3 to 5"),
        ({"name": "cars"}, "calibration.name is 'cars', expected one of 'vehicle_standing'"),
    ],
)
def test_values_outside_of_the_limits_are_refused(fields, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        GroupCalibration(**fields)


def test_by_default_a_group_keeps_its_weights_and_claims_no_data():
    group = GroupCalibration(factors=(1.0,))
    assert (group.temperature, group.agents, group.sites) == (1.0, 0, 0)


def test_factors_of_the_50_percent_ellipses_are_for_all_steps_or_none():
    assert GroupCalibration(factors=(1.0, 2.0), sigma_factors_50=(0.7, 0.6)).sigma_factors_50
    sentence = "sigma_factors_50 of any_moving are 1, expected none or one for each of the 2"
    with pytest.raises(ConfigurationError, match=sentence):
        GroupCalibration(factors=(1.0, 2.0), sigma_factors_50=(0.7,))
    with pytest.raises(ConfigurationError, match=r"sigma_factors_50 is 1\.5, expected 0\.2 to 1"):
        GroupCalibration(factors=(1.0,), sigma_factors_50=(1.5,))


def test_a_description_without_factors_of_the_50_percent_ellipses_has_ones():
    """As files of earlier versions."""
    data = json.loads(
        TaskDescription(horizon_steps=2, calibration=calibration(1.0, 2.0)).to_json()
    )
    for group in data["calibration"]["groups"]:
        del group["sigma_factors_50"]
    found = TaskDescription.from_json(json.dumps(data)).calibration
    np.testing.assert_array_equal(found.sigma_factor_50_table, np.ones((len(GROUPS), 2)))


def test_a_calibration_is_complete_or_empty():
    with pytest.raises(ConfigurationError, match=r"calibration\.groups is "):
        Calibration(groups=calibration(1.0).groups[:3])
    groups = list(calibration(1.0).groups)
    groups[2] = dataclasses.replace(groups[2], factors=(1.0, 2.0))
    with pytest.raises(ConfigurationError, match=r"factors is \[1, 2\], expected the same"):
        Calibration(groups=tuple(groups))
    assert Calibration().is_none
    assert Calibration().horizon_steps == 0


def test_the_task_description_carries_it():
    task = TaskDescription(horizon_steps=2, calibration=calibration(1.0, 2.5))
    again = TaskDescription.from_json(task.to_json())
    assert again == task
    assert again.calibration.factor_table.shape == (len(GROUPS), 2)


def test_a_description_without_one_is_read():
    data = json.loads(TaskDescription().to_json())
    del data["calibration"]
    assert TaskDescription.from_json(json.dumps(data)).calibration.is_none


def test_a_calibration_of_another_horizon_is_refused():
    text = TaskDescription(horizon_steps=3, calibration=calibration(1.0, 2.5)).to_json()
    with pytest.raises(ConfigurationError, match="factors is 2, expected 3, the steps"):
        TaskDescription.from_json(text)
