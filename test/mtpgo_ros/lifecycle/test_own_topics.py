# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Remappings by which a node would hear itself."""

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_msgs.msg import String

from mtpgo_ros.lifecycle.manager_bond import NoBond
from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode


@pytest.fixture
def activated():
    """A function that configures and activates a node with remappings and returns its failure."""
    made = []

    def activated(node_class, *remapped, again=False, **parameters):
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
        if again:
            node.trigger_deactivate()
            node.trigger_activate()
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


@pytest.mark.parametrize(
    ("remapped", "parameters", "topic"),
    [
        ("~/quality_table:=objects", {}, "/own_topics/objects"),
        ("~/predictions:=odometry_of_mine", {"ego_topic": "odometry_of_mine"}, "odometry_of_mine"),
        # Not selected yet, but it may be at any time.
        ("~/predicted_objects:=objects", {}, "/own_topics/objects"),
    ],
    ids=["scores", "ego", "later"],
)
def test_topics_that_come_later_count_as_well(activated, models, remapped, parameters, topic):
    failure = activated(PredictorNode, remapped, model=str(models["quick"]), **parameters)
    assert f"publishes on {'/own_topics/' * (topic[0] != '/')}{topic}" in failure


def test_a_topic_on_which_two_nodes_watch_each_other_is_none(activated, models, monkeypatch):
    """As that of the bond, on which both sides publish and subscribe."""

    def form_bond(node):
        node.create_subscription(String, "bond", lambda message: None, 1)
        node.create_publisher(String, "bond", 1)
        return NoBond()  # which leaves both

    monkeypatch.setattr("mtpgo_ros.lifecycle.resource_node.form_bond", form_bond)
    assert activated(PredictorNode, model=str(models["quick"]), again=True) == ""


@pytest.mark.parametrize(
    ("node_class", "remapped", "names"),
    [
        (PredictorNode, "ego_id:=objects", "objects and ego_id"),
        (PredictorNode, "objects:=odometry", "objects and odometry"),
        (PredictorNode, "lane_markings:=ego_id", "ego_id and lane_markings"),
        (RiskNode, "odometry:=predictor/predictions", "predictor/predictions and odometry"),
    ],
)
def test_two_inputs_of_different_messages_have_two_topics(
    activated, models, node_class, remapped, names
):
    given = {"model": str(models["quick"])} if node_class is PredictorNode else {}
    assert f"{names} are both the topic /own_topics/" in activated(node_class, remapped, **given)


def test_the_odometry_of_the_ego_may_be_that_of_the_objects_frame(activated, models):
    given = {"ego_topic": "odometry", "fixed_frame": "map"}
    assert activated(PredictorNode, model=str(models["quick"]), **given) == ""


def test_usual_remappings_are_none_of_these(activated, models):
    remapped = ("objects:=/tracker", "~/predictions:=/predicted", "~/markers:=/drawn")
    assert activated(PredictorNode, *remapped, model=str(models["quick"])) == ""


def test_risk_does_not_assess_its_own_output(activated):
    failure = activated(RiskNode, "~/risk:=predictor/predictions")
    assert "publishes on /own_topics/predictor/predictions and subscribes to it" in failure
