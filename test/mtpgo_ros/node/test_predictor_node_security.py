# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The security policy allows what the node uses, and files are chosen before it is active."""

import itertools

import pytest
from policy_check import check_policy
from rclpy.parameter import Parameter
from ros_helpers import borrowed_class
from ros_stubs import install_bondpy, install_tf2_ros

from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.parameters.predictor_parameters import Change, PredictorParameters


@pytest.fixture
def everything(monkeypatch, models):
    """A function that makes an active node with every option that needs a topic or a service."""
    install_tf2_ros(monkeypatch)
    install_bondpy(monkeypatch)
    borrowed_class(monkeypatch, "autoware_perception_msgs/msg/PredictedObjects")
    for user in ("mtpgo_ros.runtime.model_loading", "mtpgo_core.prediction.model_runner"):
        monkeypatch.setattr(f"{user}.is_shipped", lambda path: True)  # saves the trial
    made = []

    def everything(**more):
        given = {
            "model": str(models["lanes"]),
            "input_type": "pointcloud2",
            "fixed_frame": "map",
            "use_sim_time": True,
            "output": ["pointcloud2", "markers", "autoware"],
            **more,
        }
        made.append(
            PredictorNode(
                namespace=f"/security{next(_namespaces)}",
                parameter_overrides=[Parameter(name, value=v) for name, v in given.items()],
            )
        )
        assert str(made[-1].trigger_configure()).endswith("SUCCESS"), made[-1].failure
        assert str(made[-1].trigger_activate()).endswith("SUCCESS"), made[-1].failure
        return made[-1]

    yield everything
    for node in made:
        node.stop()
        node.destroy_node()


_namespaces = itertools.count()
"""A node that has ended is known for a while, and must not be taken for the next one."""


def test_with_every_option_the_policy_is_exactly_what_the_node_uses(everything):
    check_policy(everything(), on_demand=())


def test_the_odometry_of_the_ego_is_the_only_topic_that_has_to_be_added(everything):
    node = everything(ego_topic="localization")
    with pytest.raises(AssertionError, match="subscribe: add to predictor"):
        check_policy(node, on_demand=())
    (info,) = node.get_subscriptions_info_by_topic(f"{node.get_namespace()}/localization")
    assert info.topic_type == "nav_msgs/msg/Odometry"


def test_repeated_activation_leaves_no_further_entities(everything):
    node = everything()

    def all_of():
        topics = [one.topic_name for one in (*node.publishers, *node.subscriptions)]
        return sorted([*topics, *(one.srv_name for one in node.services)])

    before = all_of()
    for _ in range(2):
        assert str(node.trigger_deactivate()).endswith("SUCCESS")
        assert str(node.trigger_activate()).endswith("SUCCESS"), node.failure
        assert all_of() == before


def test_parameters_that_select_a_file_are_fixed_while_there_is_a_model():
    fields = PredictorParameters.__dataclass_fields__
    for name in ("model", "model_sha256"):
        assert fields[name].metadata["change"] is Change.CONFIGURE
