# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transitions that fail half-way leave nothing behind."""

import itertools
import sys
import threading

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

_others: set[threading.Thread] = set()
"""Threads from before a test, which end when they like."""


@pytest.fixture
def make(monkeypatch):
    """A function that makes a node with remappings."""
    made = []
    _others.clear()
    _others.update(threading.enumerate())
    for user in ("mtpgo_ros.runtime.model_loading", "mtpgo_core.prediction.model_runner"):
        monkeypatch.setattr(f"{user}.is_shipped", lambda path: True)  # saves the trial

    def make(node_class, *remapped, **parameters):
        arguments = ["--ros-args"]
        for one in remapped:
            arguments += ["-r", one]
        made.append(
            node_class(
                namespace="/half_way",
                cli_args=arguments,
                parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
            )
        )
        return made[-1]

    yield make
    for node in made:
        node.stop()
        node.destroy_node()


def entities(node):
    """Return what exists of a node: topics, number of timers, names of its threads."""
    return (
        sorted(one.topic_name for one in node.publishers),
        sorted(one.topic_name for one in node.subscriptions),
        len(list(node.timers)),
        len(node._managed_entities),
        sorted(
            thread.name
            for thread in set(threading.enumerate()) - _others
            if "Thread-" not in thread.name
        ),
    )


@pytest.mark.parametrize(
    ("node_class", "remapped"),
    [
        (PredictorNode, "~/markers:=predictor/predictions"),
        (RiskNode, "~/markers:=risk/risk_steps"),
    ],
)
def test_a_configuration_with_two_types_on_a_topic(make, models, node_class, remapped):
    given = {"model": str(models["quick"])} if node_class is PredictorNode else {}
    node = make(node_class, remapped, **given)
    before = entities(node)
    for _ in range(2):
        assert node.trigger_configure() == TransitionCallbackReturn.ERROR
        assert "incompatible type" in node.failure
        assert entities(node) == before


@pytest.mark.parametrize("number", range(5))
def test_an_activation_whose_nth_subscription_fails(make, models, monkeypatch, number):
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    given = {"fixed_frame": "map", "ego_topic": "odom", "input_type": "pointcloud2"}
    node = make(PredictorNode, model=str(models["lanes"]), **given)
    before = entities(node)
    create, calls = node.create_subscription, itertools.count()

    def fails(*arguments, **options):
        if next(calls) == number:
            raise RuntimeError("no more memory")
        return create(*arguments, **options)

    monkeypatch.setattr(node, "create_subscription", fails)
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() != TransitionCallbackReturn.SUCCESS
    assert "no more memory" in node.failure
    if number == 1:  # The name of the ego's topic is a parameter: a refusal, not an error.
        node.trigger_cleanup()
    assert entities(node) == before


@pytest.mark.parametrize("number", range(3))
def test_an_activation_of_risk_whose_nth_subscription_fails(make, monkeypatch, number):
    node = make(RiskNode)
    before = entities(node)
    create, calls = node.create_subscription, itertools.count()

    def fails(*arguments, **options):
        if next(calls) == number:
            raise RuntimeError("no more memory")
        return create(*arguments, **options)

    monkeypatch.setattr(node, "create_subscription", fails)
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() == TransitionCallbackReturn.ERROR
    assert entities(node) == before


def test_an_input_type_that_is_not_installed(make, models):
    node = make(PredictorNode, model=str(models["quick"]), input_type="autoware")
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    before = entities(node)
    for _ in range(2):
        assert node.trigger_activate() == TransitionCallbackReturn.FAILURE
        assert "autoware_perception_msgs" in node.failure
        assert entities(node) == before
