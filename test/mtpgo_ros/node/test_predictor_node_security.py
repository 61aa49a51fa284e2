# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The security policy allows what the node uses, and files are chosen before it is active."""

from xml.etree import ElementTree

import pytest
from ros_helpers import ROOT

from mtpgo_ros.parameters.predictor_parameters import Change, PredictorParameters

POLICY = ROOT / "config" / "sros2" / "predictor.policy.xml"
ON_DEMAND = {
    "~/predicted_objects": "with the output autoware",
    "~/health": "of supervision",
    "~/swap_model": "of supervision",
    "~/quality": "of the live scores",
    "~/quality_table": "of the live scores",
    "~/quality_markers": "of the live scores",
    "lane_markings": "of models with lanes",
    "odometry": "with fixed_frame",
    "tf": "with fixed_frame",
    "tf_static": "with fixed_frame",
    "clock": "with use_sim_time",
    "bond": "under a manager of the life cycle",
}
"""What the node does not use in every setting."""


def allowed(kind, way):
    """Return the names that the policy allows."""
    root = ElementTree.parse(POLICY).getroot()
    (profile,) = root.iter("profile")
    return {
        entry.text
        for group in profile
        if group.tag == kind and group.get(way) == "ALLOW"
        for entry in group
    }


def used(bench, names_and_types):
    """Return the names that the node uses, as the policy writes them."""
    pairs = names_and_types(bench.node.get_name(), bench.namespace)
    own = f"{bench.namespace}/predictor/"
    return {
        "~/" + name.removeprefix(own)
        if name.startswith(own)
        else name.removeprefix(bench.namespace).lstrip("/")
        for name, _ in pairs
    }


@pytest.mark.parametrize("fixed_frame", ["", "map"])
def test_the_policy_allows_what_the_node_uses_and_nothing_else(bench, fixed_frame):
    node = bench("default", fixed_frame=fixed_frame)
    for ask, kind, way in (
        (node.node.get_publisher_names_and_types_by_node, "topics", "publish"),
        (node.node.get_subscriber_names_and_types_by_node, "topics", "subscribe"),
        (node.node.get_service_names_and_types_by_node, "services", "reply"),
    ):
        names = used(node, ask)
        assert names <= allowed(kind, way), f"{way}: add to {POLICY.name}"
        assert allowed(kind, way) - names <= set(ON_DEMAND), f"{way}: remove from {POLICY.name}"
    assert not node.node.get_client_names_and_types_by_node("predictor", node.namespace)


def test_parameters_that_select_a_file_are_fixed_while_there_is_a_model():
    fields = PredictorParameters.__dataclass_fields__
    for name in ("model", "model_sha256"):
        assert fields[name].metadata["change"] is Change.CONFIGURE
