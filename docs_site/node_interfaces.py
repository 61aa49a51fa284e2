# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topics and services of the predictor, noted while a real node creates them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from msg_adapters.registry import OUTPUTS
from mtpgo_ros.node import publishers
from mtpgo_ros.node.context_subscriptions import ContextSubscriptions
from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_OF_EVERY_NODE = ("/parameter_events", "/rosout", "/clock")
_SERVICES_OF_EVERY_NODE = ("rcl_interfaces/srv/", "lifecycle_msgs/srv/", "type_description_")
_OWN_SERVICES = ("~/swap_model",)
_ANY_INPUT = "any of the input messages"

_EVERYTHING = {
    "model": "none",  # which takes no time to load, and changes no topic
    "require_model": False,
    "input_type": "pointcloud2",  # with auto there is no subscription before a publisher
    "fixed_frame": "map",
    "output": ["pointcloud2", "markers", "autoware"],
}
"""Parameters with which the node creates all of its topics."""


@dataclass(frozen=True)
class Interface:
    """A topic or service.

    Attributes:
        way: ``subscribes``, ``publishes`` or ``serves``.
        name: as in the node's code, ``~`` being its own name.
        type_name: such as ``sensor_msgs/msg/PointCloud2``.
        qos: reliability, durability where it is latched, and depth; empty for services.
    """

    way: str
    name: str
    type_name: str
    qos: str


def _ignore(*_: Any) -> None:
    """Take what a subscription would pass on."""


class _NotingNode(PredictorNode):
    """A predictor that notes what it creates."""

    def __init__(self, **options: Any) -> None:
        self.noted: list[Interface] = []
        super().__init__(**options)

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **more: Any) -> Any:
        self._note("publishes", msg_type, topic, qos_profile)
        return super().create_publisher(msg_type, topic, qos_profile, **more)

    def create_lifecycle_publisher(self, *given: Any, **more: Any) -> Any:
        self._note("publishes", *given[:3])
        return super().create_lifecycle_publisher(*given, **more)

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., None],
        qos_profile: Any,
        **more: Any,
    ) -> Any:
        self._note("subscribes", msg_type, topic, qos_profile)
        return super().create_subscription(msg_type, topic, callback, qos_profile, **more)

    def create_service(self, srv_type: Any, srv_name: str, *given: Any, **more: Any) -> Any:
        self._note("serves", srv_type, srv_name, None)
        return super().create_service(srv_type, srv_name, *given, **more)

    def _note(self, way: str, kind: type, name: str, qos: QoSProfile | int | None) -> None:
        package, _, group = kind.__module__.partition(".")
        type_name = f"{package}/{group.partition('.')[0]}/{kind.__name__}"
        profile = QoSProfile(depth=qos) if isinstance(qos, int) else qos
        own = name.replace("predictor/", "~/", 1) if name.startswith("predictor/") else name
        self.noted.append(Interface(way, own, type_name, _described(profile)))


def node_interfaces() -> list[Interface]:
    """Return the topics and services that a predictor with all outputs and inputs creates.

    Outputs whose messages are not installed are listed by the adapter's type.
    """
    context = rclpy.Context()
    rclpy.init(
        args=["--ros-args", "--log-level", "fatal"],
        context=context,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    named = {name: name for name in PredictorParameters.__dataclass_fields__ if _is_topic(name)}
    settings = _EVERYTHING | named
    overrides = [Parameter(name, value=value) for name, value in settings.items()]
    node = _NotingNode(context=context, parameter_overrides=overrides)
    try:
        node.trigger_configure()
        node.trigger_activate()
        ContextSubscriptions(node, _ignore, _ignore, node.events).close()
        found = list(dict.fromkeys(map(_general, filter(_is_own, node.noted))))
    finally:
        node.stop()
        node.destroy_node()
        context.try_shutdown()
    names = {item.name for item in found}
    for kind, topic in publishers.OUTPUT_TOPICS.items():
        if topic not in names:
            qos = next(item.qos for item in found if item.name == "~/predictions")
            found.append(Interface("publishes", topic, OUTPUTS[kind].message_type, qos))
    return found


def _is_topic(parameter: str) -> bool:
    """Whether a parameter is the name of a topic, which is shown under the parameter's name."""
    return parameter.endswith("_topic")


def _is_own(item: Interface) -> bool:
    if item.way == "serves" and item.name not in _OWN_SERVICES:
        return not item.type_name.startswith(_SERVICES_OF_EVERY_NODE)
    return item.name not in _OF_EVERY_NODE


def _general(item: Interface) -> Interface:
    """Return the topic of objects as it is before it is resolved, and without this node's type."""
    if item.name == "/objects":
        return Interface(item.way, "objects", _ANY_INPUT, item.qos)
    return item


def _described(profile: QoSProfile | None) -> str:
    if profile is None:
        return ""
    reliable = profile.reliability != ReliabilityPolicy.BEST_EFFORT
    latched = ", latched" if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL else ""
    return f"{'reliable' if reliable else 'best effort'}{latched}, keep last {profile.depth}"
