# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cleans up the entities that a failed step has created on a node."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecyclePublisher


@contextlib.contextmanager
def nothing_left_behind(node: LifecycleNode) -> Iterator[None]:
    """Destroy the publishers, subscriptions and timers that the block created if it raises.

    A constructor that raises returns no object that could be closed. Without this, its
    subscriptions would remain and call a half-constructed object.

    Args:
        node: on which the block creates something, in this thread.
    """
    publishers, subscriptions = list(node.publishers), list(node.subscriptions)
    timers = list(node.timers)
    try:
        yield
    except BaseException:
        for timer in _new(node.timers, timers):
            node.destroy_timer(timer)
        for subscription in _new(node.subscriptions, subscriptions):
            node.destroy_subscription(subscription)
        for publisher in _new(node.publishers, publishers):
            if isinstance(publisher, LifecyclePublisher):
                node.destroy_lifecycle_publisher(publisher)
            else:
                node.destroy_publisher(publisher)
        raise


def _new(now: Iterable[Any], before: list[Any]) -> list[Any]:
    """Return the entities that were created since."""
    known = set(map(id, before))
    return [entity for entity in now if id(entity) not in known]
