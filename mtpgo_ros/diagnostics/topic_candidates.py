# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Suggests topics with tracked objects where the expected one has no publisher."""

from __future__ import annotations

import re

from rclpy.node import Node

from msg_adapters.registry import INPUTS
from mtpgo_core.errors import found_names

_OF_ANYTHING = ("sensor_msgs/msg/PointCloud2", "visualization_msgs/msg/MarkerArray")
"""Types that usually hold something else: only a name then says that there are objects."""

_OBJECTS = re.compile(r"object|track", re.IGNORECASE)

_MOST = 3
"""Topics that are named; chosen."""


def other_topics(node: Node, topic: str) -> str:
    """Return a sentence on other topics that are published with tracked objects, empty for none.

    Args:
        node: the node, whose own topics do not count.
        topic: resolved name of the one that it subscribes to.
    """
    own = f"{node.get_fully_qualified_name()}/"
    namespace = node.get_namespace()
    types = {adapter.message_type for adapter in INPUTS.values()}
    found = [
        f"{name} ({kind})"
        for name, kinds in sorted(node.get_topic_names_and_types())
        for kind in kinds
        if kind in types
        and name != topic
        and not name.startswith(own)
        and (kind not in _OF_ANYTHING or _OBJECTS.search(name.removeprefix(namespace)))
        and node.count_publishers(name)
    ]
    if not found:
        return ""
    return f"objects may be on {found_names(found, _MOST)}: remap with -r objects:=TOPIC"
