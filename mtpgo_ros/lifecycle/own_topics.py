# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Remappings after which a node would hear itself, or two inputs on one topic."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rclpy.node import Node

from mtpgo_core.errors import ConfigurationError


def refuse_own_topics(node: Node, heard: Mapping[str, str], published: Iterable[str] = ()) -> None:
    """Check the topics of a node before it subscribes.

    After a wrong remapping its predictions would come back as road users, to be predicted in turn.
    Two types on one topic the middleware refuses, without naming the cause.

    Args:
        node: with its publishers.
        heard: names of the topics that it may subscribe to, before remapping, and their types.
        published: names of those that it may publish on besides its present publishers.

    Raises:
        ConfigurationError: it publishes on a topic that it subscribes to, or would take two types
            from one topic.
    """
    out = {publisher.topic_name for publisher in node.publishers}
    out.update(map(node.resolve_topic_name, published))
    names: dict[str, str] = {}
    for name, kind in heard.items():
        topic = node.resolve_topic_name(name)
        if topic in out:
            raise ConfigurationError(
                f"the node publishes on {topic} and subscribes to it, expected two topics: see"
                " the remappings"
            )
        other = names.setdefault(topic, name)
        if heard[other] != kind:
            raise ConfigurationError(
                f"{other} and {name} are both the topic {topic}, expected two topics, since they"
                " have different messages: see the remappings"
            )
