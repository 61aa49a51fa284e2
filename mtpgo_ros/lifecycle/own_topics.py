# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topics that a node would hear itself on."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node

from mtpgo_core.errors import ConfigurationError


def refuse_own_topics(node: Node, awaited: Iterable[str] = ()) -> None:
    """Check that the node publishes on no topic that it subscribes to.

    After a wrong remapping its predictions would come back as road users, to be predicted in turn.

    Args:
        node: with its publishers and subscriptions.
        awaited: resolved names of topics that it will subscribe to. Where their types differ, the
            middleware would refuse that without naming the cause.

    Raises:
        ConfigurationError: there is such a topic.
    """
    heard = {subscription.topic_name for subscription in node.subscriptions} | set(awaited)
    both = heard & {publisher.topic_name for publisher in node.publishers}
    if both:
        raise ConfigurationError(
            f"the node publishes on {min(both)} and subscribes to it, expected two topics: see the"
            " remappings"
        )
