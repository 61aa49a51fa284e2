# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node over DDS: results, faults and the life cycle; one node for all tests of this file."""

import dataclasses
import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from risk_scene import ERROR, OK, prediction
from ros_helpers import LATCHED, spin_until
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.conversions import make_header, make_pose
from msg_adapters.outputs.risk_cloud import agents_from_cloud, steps_from_cloud
from msg_adapters.predictions import prediction_to_pointcloud2
from msg_adapters.types import RclpyTypes
from mtpgo_core.risk.collision_risk import Unknown
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

NAMESPACE = "/risk_bench"
TYPES = RclpyTypes()
PATIENT_S = 600.0


class RiskBench:
    """A risk node with a planner, a predictor and a listener."""

    def __init__(self):
        given = {
            "plan_type": "path",
            "prediction_timeout": PATIENT_S,
            "plan_timeout": PATIENT_S,
            "diagnostic_period": 0.1,
            "occupancy_rate": 50.0,
            "ego_length": 4.0,
            "ego_width": 2.0,
        }
        self.node = RiskNode(
            namespace=NAMESPACE,
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        )
        self.peer = Node("peer", namespace=NAMESPACE)
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
        self.predictor = self.peer.create_publisher(PointCloud2, "predictor/predictions", 5)
        self.planner = self.peer.create_publisher(Path, "plan", 5)
        self.ego = self.peer.create_publisher(String, "ego_id", LATCHED)

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith(NAMESPACE.lstrip("/")):
                self.statuses[status.name.split()[-1]] = status

    def start(self):
        assert str(self.node.trigger_configure()).endswith("SUCCESS"), self.node.failure
        assert str(self.node.trigger_activate()).endswith("SUCCESS"), self.node.failure
        for publisher in (self.predictor, self.planner, self.ego):
            self.until(lambda p=publisher: p.get_subscription_count() > 0)
        for name in self.got:
            topic = f"{NAMESPACE}/risk/{name}"
            self.until(lambda t=topic: self.peer.count_publishers(t) > 0)
            self.until(lambda t=topic: self.node.count_subscribers(t) > 0)

    def until(self, condition):
        spin_until(self.executor, condition)

    def count(self, name):
        return self.node.events.counts().get(name, 0)

    def plan(self, *, frame_id="map", step_s=10.0, x=(0.0, 0.0)):
        """Send a plan and wait until it has come; by default the ego stands at the origin."""
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
        before = len(self.got["risk"])
        self.predictor.publish(message)
        self.until(lambda: len(self.got["risk"]) > before)
        assert self.got["risk"][-1].header == message.header
        return agents_from_cloud(self.got["risk"][-1])

    def status(self, name, level, word=""):
        self.until(
            lambda: (
                name in self.statuses
                and self.statuses[name].level == level
                and word in self.statuses[name].message
            )
        )


@pytest.fixture(scope="module")
def running():
    bench = RiskBench()
    bench.start()
    yield bench
    bench.node.stop()
    bench.executor.shutdown()
    bench.node.destroy_node()
    bench.peer.destroy_node()


@pytest.fixture
def bench(running):
    """The node with a usable plan and its usual parameters."""
    running.node.set_parameters([Parameter("prediction_timeout", value=PATIENT_S)])
    running.plan()
    return running


def test_before_a_plan_comes_the_risk_is_unknown(running):
    found = running.predict(prediction())
    assert (found["unknown"] == Unknown.NO_PLAN).all()
    running.status("plan", ERROR, "no plan has come on /risk_bench/plan yet")


def test_risk_steps_markers_and_grid_are_published(bench):
    for messages in bench.got.values():
        messages.clear()
    found = bench.predict(prediction())
    assert found["probability"][0] > 0.8
    assert found["probability"][1] == 0.0
    assert found["distance_50"][1] == pytest.approx(36.0, abs=0.5)
    bench.until(lambda: all(bench.got.values()))
    steps = steps_from_cloud(bench.got["risk_steps"][-1])
    assert steps["t"].tolist() == [1.0, 2.0] * 2
    markers = bench.got["markers"][-1].markers
    assert {marker.ns for marker in markers} >= {"risk_ways", "risk_boxes", "risk_plan"}
    grid = bench.got["occupancy"][-1]
    assert grid.header == bench.got["risk"][-1].header
    assert (grid.info.width, grid.info.resolution) == (120, 0.5)
    # The ego is in the middle; a road user stands at 3 m.
    percent = np.array(grid.data).reshape(120, 120)
    assert 70 <= percent[60, 66] <= 80
    assert percent[60, 20] == 0
    bench.status("result", OK, "highest risk")


def test_the_ego_among_the_road_users_is_left_out(bench):
    bench.ego.publish(String(data="1"))
    bench.until(lambda: bench.node._assessor._ego_topic == "1")
    found = bench.predict(prediction())
    assert found["id_0"].tolist() == [2]
    bench.ego.publish(String(data=""))
    bench.until(lambda: bench.node._assessor._ego_topic == "")


def test_a_plan_without_times_is_one_diagnostic_and_no_risk(bench):
    bench.plan(step_s=0.0)
    assert (bench.predict(prediction())["unknown"] == Unknown.NO_PLAN).all()
    bench.status("plan", ERROR, "has no times")
    bench.plan()
    assert (bench.predict(prediction())["unknown"] == Unknown.KNOWN).all()
    bench.status("plan", OK)


def test_a_plan_in_another_frame_is_one_diagnostic_and_no_risk(bench):
    bench.plan(frame_id="odom")
    assert np.isnan(bench.predict(prediction())["probability"]).all()
    bench.status("plan", ERROR, "in the frame 'odom' and the predictions in 'map'")


def test_a_plan_with_nan_is_one_diagnostic_and_no_risk(bench):
    bench.plan(x=(0.0, math.nan))
    assert np.isnan(bench.predict(prediction())["probability"]).all()
    bench.status("plan", ERROR, "expected finite numbers")


def test_old_predictions_are_unknown(bench):
    found = bench.predict(prediction(), age_s=2.0 * PATIENT_S)
    assert (found["unknown"] == Unknown.STALE).all()
    bench.status("predictions", ERROR, "predictions are stale")
    bench.until(lambda: set(bench.got["occupancy"][-1].data) == {-1})


def test_when_predictions_stop_the_last_risk_is_taken_back(bench):
    found = bench.predict(prediction())
    assert (found["unknown"] == Unknown.KNOWN).all()
    before = len(bench.got["risk"])
    bench.node.set_parameters([Parameter("prediction_timeout", value=0.05)])
    bench.until(lambda: len(bench.got["risk"]) > before)
    last = agents_from_cloud(bench.got["risk"][-1])
    assert (last["unknown"] == Unknown.STALE).all()
    assert last["id_0"].tolist() == [1, 2]
    bench.status("predictions", ERROR, "the last ones on")
    bench.until(lambda: set(bench.got["occupancy"][-1].data) == {-1})


def test_other_clouds_are_refused_and_counted(bench):
    before = bench.count("rejected")
    bench.predictor.publish(PointCloud2())
    bench.until(lambda: bench.count("rejected") > before)
    bench.status("predictions", ERROR, "holds no predictions")
    assert (bench.predict(prediction())["unknown"] == Unknown.KNOWN).all()
    bench.status("predictions", OK)


def test_a_road_user_that_is_not_finite_is_unknown(bench):
    given = prediction()
    given.covariance[1] = np.nan
    found = bench.predict(given)
    assert found["unknown"].tolist() == [Unknown.KNOWN, Unknown.NO_PREDICTION]
    bench.status("result", ERROR, "1 of 2 road users is unknown")


def test_deactivated_it_publishes_nothing_and_starts_again(bench):
    assert str(bench.node.trigger_deactivate()).endswith("SUCCESS")
    bench.status("plan", b"\x01", "not active (inactive)")
    for trigger in (
        bench.node.trigger_cleanup,
        bench.node.trigger_configure,
        bench.node.trigger_activate,
    ):
        assert str(trigger()).endswith("SUCCESS"), bench.node.failure
    bench.until(lambda: bench.predictor.get_subscription_count() > 0)
    bench.until(lambda: bench.planner.get_subscription_count() > 0)
    bench.until(lambda: bench.node.count_subscribers(f"{NAMESPACE}/risk/risk") > 0)
    bench.plan()
    assert (bench.predict(prediction())["unknown"] == Unknown.KNOWN).all()


def test_a_message_package_that_is_missing_is_named(bench):
    node = RiskNode(
        namespace="/other", parameter_overrides=[Parameter("plan_type", value="autoware")]
    )
    node.starting = True
    try:
        import autoware_planning_msgs  # noqa: F401
    except ImportError:
        assert str(node.trigger_configure()).endswith("FAILURE")
        assert "ros-jazzy-autoware-planning-msgs" in node.failure
    node.stop()
    node.destroy_node()
