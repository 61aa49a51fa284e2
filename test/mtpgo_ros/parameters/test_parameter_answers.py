# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests for parameters that rclpy cannot read are answered, by direct calls of the services."""

import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from mtpgo_ros.parameters.parameter_answers import answer_every_request

NO_TYPE = Parameter(name="rate", value=ParameterValue(type=77))
GOOD = Parameter(name="rate", value=ParameterValue(type=3, double_value=4.0))


@pytest.fixture
def node():
    one = Node("parameter_answers")
    one.declare_parameter("rate", 5.0)
    answer_every_request(one)
    yield one
    one.destroy_node()


def ask(node, kind, *parameters):
    (service,) = [one for one in node.services if one.srv_type is kind]
    return service.callback(kind.Request(parameters=parameters), kind.Response())


def test_a_value_of_no_type_is_refused_and_the_others_are_set(node):
    refused, done = ask(node, SetParameters, NO_TYPE, GOOD).results
    assert (refused.successful, done.successful) == (False, True)
    assert "parameter rate was not set: 77 is not a valid" in refused.reason
    assert node.get_parameter("rate").value == 4.0


def test_a_set_with_a_value_of_no_type_changes_nothing(node):
    result = ask(node, SetParametersAtomically, GOOD, NO_TYPE).result
    assert not result.successful
    assert "parameter rate, rate was not set" in result.reason
    assert node.get_parameter("rate").value == 5.0


@pytest.mark.parametrize("kind", [SetParameters, SetParametersAtomically])
def test_a_parameter_that_there_is_not_is_named_with_the_nearest(node, kind):
    value = ParameterValue(type=3, double_value=4.0)
    for name, end in (("ratte", ", did you mean rate?"), ("x", "; 'ros2 param list' shows")):
        response = ask(node, kind, Parameter(name=name, value=value), GOOD)
        result = response.results[0] if kind is SetParameters else response.result
        assert not result.successful
        assert result.reason.startswith(f"the node has no parameter {name}{end}")
    assert node.get_parameter("rate").value == (4.0 if kind is SetParameters else 5.0)


@pytest.mark.parametrize("kind", [SetParameters, SetParametersAtomically])
def test_what_fails_while_a_change_takes_effect_is_the_reason(node, kind):
    def fails(_parameters):
        raise RuntimeError("no such publisher")

    node.add_post_set_parameters_callback(fails)
    response = ask(node, kind, GOOD)
    result = response.results[0] if kind is SetParameters else response.result
    assert not result.successful
    assert "no such publisher" in result.reason
