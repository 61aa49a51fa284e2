# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compares a security policy of SROS 2 with what a running node uses."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ros_helpers import ROOT


def check_policy(node: Any, on_demand: Collection[str]) -> None:
    """Check that the policy of a node allows exactly what the node uses.

    Args:
        node: a running node without remapping; its policy has its name.
        on_demand: allowed names that it does not use in every setting.
    """
    policy = ROOT / "config" / "sros2" / f"{node.get_name()}.policy.xml"
    for ask, kind, way in (
        (node.get_publisher_names_and_types_by_node, "topics", "publish"),
        (node.get_subscriber_names_and_types_by_node, "topics", "subscribe"),
        (node.get_service_names_and_types_by_node, "services", "reply"),
    ):
        names, allowed = _used(node, ask), _allowed(policy, kind, way)
        assert names <= allowed, f"{way}: add to {policy.name}"
        assert allowed - names <= set(on_demand), f"{way}: remove from {policy.name}"
    assert not node.get_client_names_and_types_by_node(node.get_name(), node.get_namespace())


def _allowed(policy: Path, kind: str, way: str) -> set[str | None]:
    """Return the names that a policy allows."""
    (profile,) = ElementTree.parse(policy).getroot().iter("profile")
    return {
        entry.text
        for group in profile
        if group.tag == kind and group.get(way) == "ALLOW"
        for entry in group
    }


def _used(node: Any, names_and_types: Callable[..., Any]) -> set[str]:
    """Return the names that a node uses, as the policy writes them."""
    namespace = node.get_namespace()
    own = f"{node.get_fully_qualified_name()}/"
    return {
        "~/" + name.removeprefix(own)
        if name.startswith(own)
        else name.removeprefix(namespace).lstrip("/")
        for name, _ in names_and_types(node.get_name(), namespace)
    }
