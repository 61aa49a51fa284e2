# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A test bench for the node risk over DDS."""

import dataclasses

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_helpers import LATCHED, spin_until
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.conversions import make_header, make_pose
from msg_adapters.outputs.risk_cloud import agents_from_cloud
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.predictions.prediction_messages import PREDICTIONS
from msg_adapters.types import RclpyTypes
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

TYPES = RclpyTypes()
PATIENT_S = 600.0


class RiskBench:
    """A risk node with a planner, a predictor and a listener.

    Args:
        namespace: of the node and its peer.
        predictions_type: class of the messages with predictions.
        parameters: of the node.
    """

    def __init__(self, namespace, predictions_type=PointCloud2, **parameters):
        self.namespace = namespace
        given = {
            "plan_type": "path",
            "prediction_timeout": PATIENT_S,
            "plan_timeout": PATIENT_S,
            "diagnostic_period": 0.1,
            "occupancy_rate": 50.0,
            "ego_length": 4.0,
            "ego_width": 2.0,
            **parameters,
        }
        self.node = RiskNode(
            namespace=namespace,
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        )
        self.peer = Node("peer", namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.got = {name: [] for name in ("risk", "risk_steps", "markers", "occupancy")}
        kinds = (PointCloud2, PointCloud2, MarkerArray, OccupancyGrid)
        for name, kind in zip(self.got, kinds, strict=True):
            qos = LATCHED if name == "occupancy" else 10
            self.peer.create_subscription(kind, f"risk/{name}", self.got[name].append, qos)
        self.statuses = {}
        self.peer.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 20)
        adapter = PREDICTIONS[given.get("prediction_type", "pointcloud2")]
        self.predictor = self.peer.create_publisher(predictions_type, adapter.topic, 5)
        self.planner = self.peer.create_publisher(Path, "plan", 5)
        self.ego = self.peer.create_publisher(String, "ego_id", LATCHED)

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith(self.namespace.lstrip("/")):
                self.statuses[status.name.split()[-1]] = status

    def start(self):
        assert str(self.node.trigger_configure()).endswith("SUCCESS"), self.node.failure
        assert str(self.node.trigger_activate()).endswith("SUCCESS"), self.node.failure
        for publisher in (self.predictor, self.planner, self.ego):
            self.until(lambda p=publisher: p.get_subscription_count() > 0)
        for name in self.got:
            topic = f"{self.namespace}/risk/{name}"
            self.until(lambda t=topic: self.peer.count_publishers(t) > 0)
            self.until(lambda t=topic: self.node.count_subscribers(t) > 0)

    def until(self, condition):
        spin_until(self.executor, condition)

    def count(self, name):
        return self.node.events.counts().get(name, 0)

    def plan(self, *, frame_id="map", step_s=PATIENT_S, x=(0.0, 0.0)):
        """Send a plan and wait until it has come; by default the ego stands at the origin.

        It lasts longer than any pause of the machine.
        """
        before, now_ns = self.count("plans"), self.node.get_clock().now().nanoseconds
        poses = [
            TYPES.make(
                "geometry_msgs/msg/PoseStamped",
                header=make_header(TYPES, now_ns + round(1e9 * step_s * i), frame_id),
                pose=make_pose(TYPES, np.array([place, 0.0]), 0.0, 0.0),
            )
            for i, place in enumerate(x)
        ]
        header = make_header(TYPES, now_ns, frame_id)
        self.planner.publish(Path(header=header, poses=poses))
        self.until(lambda: self.count("plans") > before)

    def predict(self, given, *, age_s=0.0):
        """Send predictions and return the risk of the road users that comes back."""
        stamp_ns = self.node.get_clock().now().nanoseconds - round(1e9 * age_s)
        message = prediction_to_pointcloud2(dataclasses.replace(given, stamp_ns=stamp_ns), TYPES)
        found = self.answer(message)
        assert self.got["risk"][-1].header == message.header
        return found

    def answer(self, message):
        """Send a message, or its bytes, and return the risk of the road users that comes back."""
        before = len(self.got["risk"])
        self.predictor.publish(message)
        self.until(lambda: len(self.got["risk"]) > before)
        return agents_from_cloud(self.got["risk"][-1])

    def close(self):
        self.node.stop()
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()

    def grid_of(self, given):
        """Send predictions until the grid of one of them comes, which has a rate of its own."""
        sent = []

        def came():
            if self.got["occupancy"] and self.got["occupancy"][-1].header in sent:
                return True
            self.predict(given)
            sent.append(self.got["risk"][-1].header)
            return False

        self.until(came)
        return self.got["occupancy"][-1]

    def status(self, name, level, word=""):
        self.until(
            lambda: (
                name in self.statuses
                and self.statuses[name].level == level
                and word in self.statuses[name].message
            )
        )
