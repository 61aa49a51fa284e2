# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Remappings by which a node would hear itself."""

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode


@pytest.fixture
def activated():
    """A function that configures and activates a node with remappings and returns its failure."""
    made = []

    def activated(node_class, *remapped, **parameters):
        arguments = ["--ros-args"]
        for one in remapped:
            arguments += ["-r", one]
        node = node_class(
            namespace="/own_topics",
            cli_args=arguments,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        made.append(node)
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        done = node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        assert done != bool(node.failure)
        return node.failure

    yield activated
    for node in made:
        node.stop()
        node.destroy_node()


@pytest.mark.parametrize(
    ("remapped", "topic"),
    [
        ("~/predictions:=objects", "/own_topics/objects"),
        ("objects:=predictor/predictions", "/own_topics/predictor/predictions"),
        ("~/markers:=objects", "/own_topics/objects"),
        ("~/health:=ego_id", "/own_topics/ego_id"),
        ("/diagnostics:=objects", "/own_topics/objects"),
    ],
)
def test_predictions_do_not_come_back_as_objects(activated, models, remapped, topic):
    failure = activated(PredictorNode, remapped, model=str(models["quick"]))
    assert f"publishes on {topic} and subscribes to it" in failure


def test_usual_remappings_are_none_of_these(activated, models):
    remapped = ("objects:=/tracker", "~/predictions:=/predicted", "~/markers:=/drawn")
    assert activated(PredictorNode, *remapped, model=str(models["quick"])) == ""


def test_risk_does_not_assess_its_own_output(activated):
    failure = activated(RiskNode, "~/risk:=predictor/predictions")
    assert "publishes on /own_topics/predictor/predictions and subscribes to it" in failure
