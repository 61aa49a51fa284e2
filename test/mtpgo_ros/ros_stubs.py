# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for the packages tf2_ros and bondpy, which are not on pip.

They create on a node what the originals create, and end it in the same way.
"""

import sys
import types

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger


def install_tf2_ros(monkeypatch):
    """Install a tf2_ros without a transform; return the buffers that were made."""
    buffers = []

    class Buffer:
        def __init__(self, cache_time=None, node=None):
            self.cleared = 0
            buffers.append(self)
            if node is not None:  # and it is never destroyed
                node.create_service(Trigger, "tf2_frames", lambda request, response: response)

        def lookup_transform(self, target, source, when):
            raise LookupError(f"{source} does not exist")

        def clear(self):
            self.cleared += 1

    class TransformListener:
        def __init__(self, buffer, node, *, spin_thread):
            latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.node = node
            self.subscriptions = [
                node.create_subscription(String, "/tf", lambda message: None, 100),
                node.create_subscription(String, "/tf_static", lambda message: None, latched),
            ]

        def unregister(self):
            for subscription in self.subscriptions:
                self.node.destroy_subscription(subscription)

    module = types.SimpleNamespace(Buffer=Buffer, TransformListener=TransformListener)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)
    return buffers


def install_bondpy(monkeypatch):
    """Install a bondpy whose bonds end as the original's: what they created is invalidated."""

    class Bond:
        def __init__(self, topic, identity, node):
            self.topic, self.node = topic, node
            self.pub = node.create_publisher(String, topic, 1)

        def start(self):
            self.sub = self.node.create_subscription(String, self.topic, lambda message: None, 1)

        def shutdown(self):
            self.sub.destroy()
            self.pub.destroy()

    module = types.SimpleNamespace(Bond=Bond)
    monkeypatch.setitem(sys.modules, "bondpy", types.SimpleNamespace(bondpy=module))
    monkeypatch.setitem(sys.modules, "bondpy.bondpy", module)
