# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters as a set of values, and the file that sets them."""

import dataclasses
from pathlib import Path

import pytest
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file

from msg_adapters.conversions import TWIST_FRAMES as ADAPTER_TWIST_FRAMES
from msg_adapters.registry import INPUTS, OUTPUTS
from mtpgo_core.errors import ConfigurationError
from mtpgo_ros.parameters.predictor_parameters import (
    INPUT_TYPES,
    OUTPUT_KINDS,
    TWIST_FRAMES,
    PredictorParameters,
    check,
    updated,
)

CONFIG = Path(__file__).resolve().parents[3] / "config" / "predictor.yaml"


def test_the_defaults_are_valid_and_described():
    check(PredictorParameters())
    for field in dataclasses.fields(PredictorParameters):
        assert field.metadata["description"].endswith("."), field.name


def test_the_choices_are_those_that_the_adapters_offer():
    assert set(INPUT_TYPES) == {"auto", *INPUTS}
    assert set(OUTPUT_KINDS) == set(OUTPUTS)
    assert set(TWIST_FRAMES) == set(ADAPTER_TWIST_FRAMES)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"rate": 0.0}, ["rate", "0", "0.1 to 50"]),
        ({"rate": float("nan")}, ["rate", "nan"]),
        ({"max_agents": 0}, ["max_agents", "1 to 4096"]),
        ({"graph": "star"}, ["graph", "'star'", "'cover'"]),
        ({"input_type": "lidar"}, ["input_type", "'autoware'"]),
        ({"output": ("pointcloud2", "pigeon")}, ["output", "'pigeon'", "'markers'"]),
        ({"output": ()}, ["output", "empty"]),
        ({"model": " "}, ["model", "empty"]),
        ({"class_map": "kitty"}, ["parameter class_map: ", "'kitty'", "'nuscenes'", "YAML file"]),
        ({"class_map": "y" * 5000}, ["parameter class_map: ", "neither a preset nor a file"]),
        ({"lane_file": "/dev/zero"}, ["parameter lane_file: ", "a pipe or a device"]),
        ({"lane_offset": "1,2,3"}, ["parameter lane_offset is '1,2,3', expected x and y"]),
        ({"model_sha256": "abc"}, ["model_sha256", "'abc'", "64 digits"]),
        ({"ego_topic": "a b"}, ["ego_topic", "'a b'", "nav_msgs/Odometry"]),
        ({"ego_topic": "/é"}, ["ego_topic", "'/é'", "nav_msgs/Odometry"]),
        ({"ego_class": "tank"}, ["ego_class", "'tank'", "'truck'"]),
        ({"ego_length": 0.0}, ["ego_length", "0.1 to 100"]),
        ({"rate": 0.5}, ["input_timeout", "rate", "2 s"]),
    ],
)
def test_a_bad_value_is_named_with_what_was_expected(values, words):
    with pytest.raises(ConfigurationError) as caught:
        updated(PredictorParameters(), values)
    for word in words:
        assert word in str(caught.value)


def test_names_of_others_are_ignored():
    assert updated(PredictorParameters(), {"use_sim_time": True}) == PredictorParameters()


def test_the_parameter_file_holds_every_parameter_with_its_default():
    given = parameter_dict_from_yaml_file(str(CONFIG), use_wildcard=True)
    values = {
        name.rpartition(".")[2]: Parameter.from_parameter_msg(message).value
        for name, message in given.items()
    }
    values.pop("use_sim_time", None)
    defaults = {
        field.name: list(field.default) if isinstance(field.default, tuple) else field.default
        for field in dataclasses.fields(PredictorParameters)
    }
    assert values == defaults
    types = {name: type(value) for name, value in values.items()}
    assert types == {name: type(value) for name, value in defaults.items()}


def test_a_file_that_is_gone_hinders_no_other_change(tmp_path):
    path = tmp_path / "classes.yaml"
    path.write_text("automobile: car\n")
    current = updated(PredictorParameters(), {"class_map": str(path)})
    path.unlink()
    assert updated(current, {"rate": 4.0}).rate == 4.0
    with pytest.raises(ConfigurationError, match="parameter class_map"):
        updated(PredictorParameters(), {"class_map": str(path)})
