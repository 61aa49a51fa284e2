# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One line for each given parameter that the node does not have: it would be without effect.

A parameter given to this node is a mistake, and gets a warning. A file may also hold parameters
for all nodes (under ``/**``), most of which other nodes have: those get a line of information.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.parameter import parameter_dict_from_yaml_file

from mtpgo_core.errors import did_you_mean

_SHARED_KEYS = ("/**", "/*", "**", "*")
"""Keys of a parameter file that address nodes of any name."""

_FOREIGN_PREFIXES = ("bond_disable_heartbeat_timeout",)
"""Parameters that other libraries read without declaring them at the start."""

_QOS = "qos_overrides."
"""Begins parameters that rclpy reads for topics whose QoS may be overridden; no topic here is."""

_LIST = "; 'ros2 param list' shows its parameters"


def report_unknown_parameters(node: Node, arguments: Sequence[str]) -> None:
    """Log every given parameter that is not declared, with the nearest name.

    Args:
        node: all of its parameters are declared.
        arguments: of the process.
    """
    given = [
        name
        for name in node._parameter_overrides
        if not node.has_parameter(name) and not name.startswith(_FOREIGN_PREFIXES)
    ]
    if not given:
        return
    shared = _shared_names(node, arguments)
    for name in given:
        hint = nearest(node, name)
        sentence = f"parameter {name} has no effect: the node has no such parameter"
        if name.startswith(_QOS):
            hint = ""
            sentence = f"parameter {name} has no effect: the QoS of the node's topics is fixed"
        if name in shared:
            near = hint if hint != _LIST else ""
            node.get_logger().info(f"{sentence} (given for all nodes){near}")
        else:
            node.get_logger().warning(f"{sentence}{hint}")


def nearest(node: Node, name: str) -> str:
    """Return the end of a sentence about a parameter that the node does not have: the nearest."""
    return did_you_mean(name, node._parameters) or _LIST


def _shared_names(node: Node, arguments: Sequence[str]) -> set[str]:
    """Return the parameters that only parameter files give, under keys for nodes of any name."""
    name, path = node.get_name(), node.get_fully_qualified_name()
    own_keys = (path, path.lstrip("/"), name, f"/{name}", f"/**/{name}", f"/*/{name}")
    shared, own = set(), set()
    for option, value in itertools.pairwise(arguments):
        if option == "--params-file":
            shared |= _names_in_file(value, _SHARED_KEYS)
            own |= _names_in_file(value, own_keys)
        elif option in ("-p", "--param"):
            own.add(value.partition(":=")[0].rpartition(":")[2])
    return shared - own


def _names_in_file(path: str, keys: Sequence[str]) -> set[str]:
    """Return the parameters that a file gives under any of these keys."""
    names: set[str] = set()
    for key in dict.fromkeys(keys):
        try:
            names |= set(parameter_dict_from_yaml_file(path, target_nodes=[key]))
        except Exception:  # The key is not there; rcl has read and checked the file itself.
            continue
    return names
