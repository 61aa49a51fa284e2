# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A predictor as a launch file starts it, and a peer that speaks the stack's messages in bytes.

The message packages of the stacks are not on pip. Their classes are stand-ins here that borrow the
type support of a message that is installed: publishers and subscribers exchange the bytes as they
are, and only the decoding of rclpy, which needs compiled code of the package, is rosbags' instead.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from recipe_file import RecipeNode
from ros_helpers import LIMIT_S, borrowed_class, spin_until
from sensor_msgs.msg import PointCloud2
from stack_messages import StackMessages

from msg_adapters.predictions import prediction_from_pointcloud2
from mtpgo_core.schema import Prediction
from mtpgo_ros.node import objects_subscription
from mtpgo_ros.node.inference.prediction_request import PredictionRequest
from mtpgo_ros.node.predictor_node import PredictorNode


def stand_in(monkeypatch: Any, typestore: Any, name: str) -> type:
    """Make ``package.msg`` importable with a class for this message, decoded by ``typestore``."""
    found = borrowed_class(monkeypatch, name)
    decode = objects_subscription.deserialize_message

    def deserialize(data: bytes, kind: type) -> Any:
        stack_type = getattr(kind, "stack_type", None)
        return typestore.deserialize_cdr(data, stack_type) if stack_type else decode(data, kind)

    monkeypatch.setattr(objects_subscription, "deserialize_message", deserialize)
    return found


class StackBench:
    """The predictor of a recipe and its peer.

    Args:
        recipe: what the launch file starts.
        objects_type: class of the objects, installed or a stand-in.
        model: file of a model that is fast.

    Attributes:
        predictions: what was published on ``~/predictions``, decoded.
    """

    def __init__(self, recipe: RecipeNode, objects_type: type, model: Path) -> None:
        self.node = PredictorNode(
            cli_args=recipe.ros_arguments(),
            use_global_arguments=False,
            parameter_overrides=[Parameter("model", value=str(model))],
        )
        self.peer = Node("peer", use_global_arguments=False)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.predictions: list[Prediction] = []
        self.peer.create_subscription(PointCloud2, self.topic("predictions"), self._on_cloud, 10)
        self.objects = self.peer.create_publisher(objects_type, recipe.remaps["objects"], 5)

    def _on_cloud(self, message: Any) -> None:
        self.predictions.append(prediction_from_pointcloud2(message))

    def topic(self, name: str) -> str:
        """Return one of the node's own topics in full."""
        return f"{self.node.get_fully_qualified_name()}/{name}"

    def listen(self, kind: type, topic: str) -> list[bytes]:
        """Return a list to which the bytes of every message are added."""
        heard: list[bytes] = []
        self.peer.create_subscription(kind, topic, heard.append, 5, raw=True)
        self.until(lambda: self.peer.count_publishers(topic) > 0)
        self.until(lambda: self.node.count_subscribers(topic) > 0)
        return heard

    def start(self) -> None:
        """Configure and activate as the process does, unless a manager is to do it."""
        if self.node.parameters.autostart:
            assert str(self.node.trigger_configure()).endswith("SUCCESS"), self.node.failure
            assert str(self.node.trigger_activate()).endswith("SUCCESS"), self.node.failure
            self.wait_for_peers()

    def wait_for_peers(self) -> None:
        """Wait until both sides have found each other; give the model unlimited time."""
        pipeline = self.node._pipeline
        limit_ns = round(LIMIT_S * 1e9)
        pipeline._request = lambda window, stamp_ns, received_ns: PredictionRequest(
            window, stamp_ns, received_ns, budget_ns=limit_ns, deadline_ns=limit_ns
        )
        self.until(lambda: self.objects.get_subscription_count() > 0)
        self.until(lambda: pipeline.objects._subscription is not None)
        self.until(lambda: pipeline.objects._subscription.get_publisher_count() > 0)
        self.until(lambda: self.node.count_subscribers(self.topic("predictions")) > 0)
        self.until(lambda: self.peer.count_publishers(self.topic("predictions")) > 0)

    def send(self, messages: StackMessages, stack: str, time_s: float) -> None:
        """Publish the bytes of a stack's message and wait until the node has received them."""
        before = self.node.events.counts().get("messages", 0)
        self.objects.publish(messages.octets(stack, time_s))
        self.until(lambda: self.node.events.counts().get("messages", 0) > before)

    def until(self, condition: Callable[[], Any]) -> None:
        """Spin until the condition holds."""
        spin_until(self.executor, condition)

    def close(self) -> None:
        """Stop and destroy everything."""
        self.node.stop()
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()
