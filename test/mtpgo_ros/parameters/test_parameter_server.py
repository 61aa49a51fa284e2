# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of a node: conversion, checks of changes, descriptions."""

import dataclasses

import pytest
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from mtpgo_core.errors import ConfigurationError
from mtpgo_ros.parameters.parameter_server import ParameterServer, descriptor
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters, updated


def serve(node, **options):
    return ParameterServer(node, PredictorParameters(), updated, **options)


def test_values_of_related_types_are_converted():
    node = Node(
        "related",
        parameter_overrides=[
            Parameter("rate", value=4),
            Parameter("ego_id", value=17),
            Parameter("output", value="markers"),
        ],
    )
    changes = []
    server = serve(node, may_reconfigure=lambda: False, on_change=changes.append)
    assert (server.value.rate, server.value.ego_id) == (4.0, "17")
    assert server.value.output == ("markers",)
    result = node.set_parameters_atomically([Parameter("radius", value=30)])
    assert result.successful
    assert server.value.radius == 30.0
    assert [change.radius for change in changes] == [30.0]
    assert node.get_parameter("radius").value == 30.0
    node.destroy_node()


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rate", "fast", "a number"),
        ("max_agents", 3.5, "a whole number"),
        ("require_model", 1, "true or false"),
        ("output", 7, "a list of text"),
        ("model", True, "text"),
    ],
)
def test_a_value_of_another_type_is_refused_with_a_sentence(name, value, words):
    node = Node("wrong", parameter_overrides=[Parameter(name, value=value)])
    with pytest.raises(ConfigurationError, match=words):
        serve(node, may_reconfigure=lambda: True, on_change=print)
    node.destroy_node()


@pytest.fixture
def server():
    """A node and its server, which is configured: may_reconfigure is false."""
    node, changes = Node("parameters"), []
    yield (
        node,
        serve(node, may_reconfigure=lambda: False, on_change=changes.append),
        changes,
    )
    node.destroy_node()


@pytest.mark.parametrize("kind", [SetParameters, SetParametersAtomically])
def test_a_later_value_of_another_type_is_refused_with_name_and_value(server, kind):
    node, parameters, _ = server
    (service,) = [one for one in node.services if one.srv_type is kind]
    for name, value, words in (
        ("budget", "high", "parameter budget is 'high', expected a number"),
        ("max_agents", 3.5, "parameter max_agents is 3.5, expected a whole number"),
    ):
        asked = kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        response = service.callback(asked, kind.Response())
        result = response.results[0] if kind is SetParameters else response.result
        assert (result.successful, result.reason) == (False, words)
    assert parameters.value == PredictorParameters()


def test_a_refused_set_changes_nothing(server):
    node, parameters, changes = server
    before = parameters.value
    given = [Parameter("max_modes", value=1), Parameter("rate", value=0.5)]
    result = node.set_parameters_atomically(given)
    assert not result.successful
    assert "input_timeout is 1 s, shorter than a period" in result.reason
    assert (parameters.value, changes) == (before, [])
    assert node.get_parameter("max_modes").value == 8


def test_a_parameter_of_the_configuration_cannot_change_later_except_to_itself(server):
    node, _, changes = server
    result = node.set_parameters_atomically([Parameter("model", value="other")])
    assert not result.successful
    assert "parameter model can change only while the node is unconfigured" in result.reason
    assert node.set_parameters_atomically([Parameter("model", value="default")]).successful
    assert changes == []


def test_parameters_are_described_with_their_limits():
    fields = {field.name: field for field in dataclasses.fields(PredictorParameters)}
    rate = descriptor(fields["rate"])
    assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (
        0.1,
        50.0,
    )
    agents = descriptor(fields["max_agents"])
    assert (agents.integer_range[0].from_value, agents.integer_range[0].to_value) == (1, 4096)
    assert "One of '', 'ego', 'cover', 'each', 'scene'." in (
        descriptor(fields["graph"]).additional_constraints
    )
    assert descriptor(fields["autostart"]).read_only
    assert not descriptor(fields["model"]).read_only
