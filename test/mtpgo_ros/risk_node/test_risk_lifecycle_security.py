# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The policy of risk allows what the node uses, and the displays show what it publishes."""

import itertools
import json

import pytest
import yaml
from policy_check import check_policy
from rclpy.parameter import Parameter
from ros_helpers import ROOT, borrowed_class
from ros_stubs import install_bondpy, install_tf2_ros

from msg_adapters.outputs.risk_markers import BOXES, LABELS, PLAN, WAYS
from mtpgo_core.errors import FrameError
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

SHOWN_BY = {
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Map": "nav_msgs/msg/OccupancyGrid",
}
"""Displays of RViz -> what they draw."""

TF = {"tf", "tf_static"}
"""Listened to from the first plan on that is in another frame than the predictions."""

_namespaces = itertools.count()
"""A node that has ended is known for a while, and must not be taken for the next one."""


@pytest.fixture
def node(monkeypatch, request):
    """An active node with the types of predictions and plan that the test names."""
    prediction_type, plan_type = request.param
    borrowed_class(monkeypatch, "autoware_perception_msgs/msg/PredictedObjects")
    install_tf2_ros(monkeypatch)
    install_bondpy(monkeypatch)
    given = {
        "prediction_type": prediction_type,
        "plan_type": plan_type,
        "use_sim_time": True,
    }
    made = RiskNode(
        namespace=f"/risk_security{next(_namespaces)}",
        parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
    )
    assert str(made.trigger_configure()).endswith("SUCCESS"), made.failure
    assert str(made.trigger_activate()).endswith("SUCCESS"), made.failure
    yield made
    made.stop()
    made.destroy_node()


@pytest.mark.parametrize(
    ("node", "others"),
    [
        (("pointcloud2", "odometry"), {"predictor/predicted_objects", "plan"}),
        (("autoware", "path"), {"predictor/predictions", "odometry"}),
    ],
    indirect=["node"],
)
def test_the_policy_allows_what_the_node_uses_and_nothing_else(node, others):
    check_policy(node, TF | others)
    with pytest.raises(FrameError, match="odom does not exist"):
        node._transform.pose("map", "odom", 1)
    check_policy(node, others)


@pytest.mark.parametrize("node", [("pointcloud2", "odometry")], indirect=True)
def test_the_displays_show_what_the_node_publishes(node):
    published = dict(
        node.get_publisher_names_and_types_by_node(node.get_name(), node.get_namespace())
    )
    published = {
        name.removeprefix(node.get_namespace()): types for name, types in published.items()
    }
    file = yaml.safe_load((ROOT / "config" / "predictor.rviz").read_text())
    displays = [
        one
        for one in file["Visualization Manager"]["Displays"]
        if one.get("Topic", {}).get("Value", "").startswith("/risk/")
    ]
    assert {one["Topic"]["Value"] for one in displays} == {"/risk/markers", "/risk/occupancy"}
    for one in displays:
        topic = one["Topic"]
        assert published[topic["Value"]] == [SHOWN_BY[one["Class"]]]
        (info,) = node.get_publishers_info_by_topic(node.get_namespace() + topic["Value"])
        latched = topic["Durability Policy"] == "Transient Local"
        assert (info.qos_profile.durability.name == "TRANSIENT_LOCAL") == latched
    namespaces = {WAYS, BOXES, LABELS, PLAN}
    (markers,) = [set(one["Namespaces"]) for one in displays if "Namespaces" in one]
    assert markers == namespaces
    panel = json.loads((ROOT / "config" / "foxglove.json").read_text())["configById"]
    shown = {name: how for name, how in panel["3D!predictor"]["topics"].items() if "risk" in name}
    assert set(shown) <= set(published)
    assert set(shown["/risk/markers"]["namespaces"]) == namespaces
