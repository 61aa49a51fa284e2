# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The bond by which a lifecycle manager of nav2 notices that the node has died."""

from __future__ import annotations

from typing import Any, Protocol

from rclpy.lifecycle import LifecycleNode


class ManagerBond(Protocol):
    """A bond that exists while the node is active."""

    def close(self) -> None:
        """Break the bond."""


class NoBond:
    """No bond: bondpy is not installed."""

    def close(self) -> None:
        """Do nothing."""


class _BondpyBond:
    """A bond of the package bondpy, on the topic and under the name that nav2 expects.

    Args:
        node: the node.
        bond_class: bondpy's class.
    """

    def __init__(self, node: LifecycleNode, bond_class: Any) -> None:
        self._node = node
        self._bond = bond_class("bond", node.get_name(), node)
        self._bond.start()

    def close(self) -> None:
        """Break the bond."""
        self._bond.shutdown()
        # bondpy invalidates them only: the node would keep them, and fail at looking at them.
        for name, destroy in (
            ("sub", self._node.destroy_subscription),
            ("pub", self._node.destroy_publisher),
        ):
            if hasattr(self._bond, name):
                destroy(getattr(self._bond, name))


def form_bond(node: LifecycleNode) -> ManagerBond:
    """Form the bond if bondpy is installed; without a manager it has no effect.

    A bond that cannot be formed is logged: the node works without one.
    """
    try:
        from bondpy.bondpy import Bond
    except ImportError:
        return NoBond()
    try:
        return _BondpyBond(node, Bond)
    except Exception as error:  # Its constructor differs between versions.
        node.get_logger().warning(f"no bond to a lifecycle manager: {error}")
        return NoBond()
