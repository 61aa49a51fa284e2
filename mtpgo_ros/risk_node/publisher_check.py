# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the publishers of a topic are those that a subscription expects: one, and heard."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from mtpgo_ros.node.objects_subscription import types_not_heard


def publisher_problem(node: Node, topic: str, qos: QoSProfile) -> str:
    """Return what is wrong with a topic's publishers, empty if nothing is.

    Args:
        node: the node that subscribes.
        topic: resolved name.
        qos: of the subscription.
    """
    publishers = node.get_publishers_info_by_topic(topic)
    own = (node.get_name(), node.get_namespace())
    taken = {
        info.topic_type
        for info in node.get_subscriptions_info_by_topic(topic)
        if (info.node_name, info.node_namespace) == own
    }
    others = {info.topic_type for info in publishers} - taken
    if taken and others:
        return types_not_heard(topic, others, taken)
    reliable = qos.reliability == ReliabilityPolicy.RELIABLE
    if reliable and any(
        info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for info in publishers
    ):
        return f"topic {topic}: a publisher that is best effort is not heard, expected reliable"
    if len(publishers) > 1:
        return (
            f"topic {topic} has {len(publishers)} publishers, expected one: the risk is that of"
            " the last message; one that was killed is still known for 20 s"
        )
    return ""
