# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node over DDS: results, faults and the life cycle; one node for all tests of this file."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from risk_bench import PATIENT_S, TYPES, RiskBench
from risk_scene import ERROR, OK, WARN, prediction
from ros_helpers import LATCHED
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.outputs.risk_cloud import agents_from_cloud, steps_from_cloud
from msg_adapters.predictions import prediction_to_pointcloud2
from mtpgo_core.risk.collision_risk import Unknown
from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

NAMESPACE = "/risk_bench"
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture(scope="module")
def running():
    bench = RiskBench(NAMESPACE)
    bench.start()
    yield bench
    bench.close()


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
    bench.until(lambda: bench.got["risk_steps"] and bench.got["markers"])
    steps = steps_from_cloud(bench.got["risk_steps"][-1])
    assert steps["t"].tolist() == [1.0, 2.0] * 2
    markers = bench.got["markers"][-1].markers
    assert {marker.ns for marker in markers} >= {"risk_ways", "risk_boxes", "risk_plan"}
    grid = bench.grid_of(prediction())
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


def test_an_occupancy_beyond_the_predictions_is_unknown(bench):
    def window(begin_s, until_s):
        values = {"occupancy_from": begin_s, "occupancy_until": until_s}
        bench.node.set_parameters_atomically([Parameter(k, value=v) for k, v in values.items()])
        return set(bench.grid_of(prediction()).data)

    assert window(30.0, 60.0) == {-1}
    bench.status("result", ERROR, "occupancy_from is 30 s, and the predictions end at 2.0 s")
    assert -1 not in window(0.0, 60.0)
    bench.status("result", WARN, "is that until 2.0 s, where the predictions end")
    assert -1 not in window(0.0, 2.0)
    bench.status("result", OK)


def test_a_plan_that_is_too_long_is_refused_before_it_is_decoded(bench):
    before = bench.count("rejected_plans")
    bench.planner.publish(Path(poses=[PoseStamped()] * 10_001))
    bench.until(lambda: bench.count("rejected_plans") > before)
    assert (bench.predict(prediction())["unknown"] == Unknown.NO_PLAN).all()
    bench.status("plan", ERROR, "has 10001 poses, expected at most 10000")


def test_a_plan_at_the_speed_of_a_jet_gives_no_low_risk(bench):
    bench.plan(step_s=10.0, x=(0.0, 1e4))
    assert (bench.predict(prediction())["unknown"] == Unknown.NO_PLAN).all()
    bench.status("plan", ERROR, "moves 1e+04 m in 10 s")


def test_numbers_beyond_belief_are_unknown_and_leave_the_others(bench):
    given = prediction()
    given.covariance[1] *= 1e30
    found = bench.predict(given)
    assert found["unknown"].tolist() == [Unknown.KNOWN, Unknown.NO_PREDICTION]
    assert math.isnan(found["probability"][1])
    bench.status("predictions", WARN, "1 of 2 road users have no usable covariance")


def test_a_stamp_that_no_message_can_hold_is_refused(bench):
    before = bench.count("rejected")
    message = prediction_to_pointcloud2(prediction(), TYPES)
    message.header.stamp.sec, message.header.stamp.nanosec = 2**31 - 1, 2**32 - 1
    bench.predictor.publish(message)
    bench.until(lambda: bench.count("rejected") > before)
    bench.status("predictions", ERROR, "stamp is 2147483647 s and 4294967295 ns")
    assert (bench.predict(prediction())["unknown"] == Unknown.KNOWN).all()


@pytest.fixture
def stranger():
    """A node of another process, as the middleware sees it."""
    context = Context()
    context.init()
    node = Node("stranger", namespace=NAMESPACE, context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_incompatible_or_several_publishers_are_reported(bench, stranger):
    topic = "predictor/predictions"
    for kind, qos, words in (
        (String, 5, "a publisher of std_msgs/msg/String is not heard, the node takes sensor_msgs"),
        (PointCloud2, BEST_EFFORT, "a publisher that is best effort is not heard"),
        (PointCloud2, 5, "has 2 publishers, expected one"),
    ):
        other = stranger.create_publisher(kind, topic, qos)
        bench.status("predictions", WARN, words)
        stranger.destroy_publisher(other)
    planner = stranger.create_publisher(Path, "plan", 5)
    bench.status("plan", WARN, "has 2 publishers, expected one")
    stranger.destroy_publisher(planner)
    bench.predict(prediction())
    bench.status("plan", OK)
    bench.status("predictions", OK)


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


def test_what_was_found_before_a_deactivation_is_not_reported_after_it(bench):
    given = prediction()
    given.covariance[1] = np.nan
    bench.predict(given)
    bench.status("result", ERROR, "1 of 2 road users is unknown")
    assert str(bench.node.trigger_deactivate()).endswith("SUCCESS")
    bench.status("result", WARN, "not active")
    assert str(bench.node.trigger_activate()).endswith("SUCCESS")
    bench.status("result", OK, "no predictions have come yet")
    values = {value.key: value.value for value in bench.statuses["result"].values}
    assert values["agents"] == "0"
    bench.until(lambda: bench.predictor.get_subscription_count() > 0)
    bench.until(lambda: bench.planner.get_subscription_count() > 0)


def grids_heard_late(bench):
    """Subscribe to the latched grid anew, and return the grids that come."""
    heard = []
    late = bench.peer.create_subscription(OccupancyGrid, "risk/occupancy", heard.append, LATCHED)
    return late, heard


def test_a_grid_of_the_past_is_taken_back_for_those_who_come_later():
    bench = RiskBench("/risk_latched")
    try:
        bench.start()
        bench.plan()
        assert set(bench.grid_of(prediction()).data) != {-1}
        listener = next(s for s in bench.peer.subscriptions if s.topic_name.endswith("occupancy"))
        bench.peer.destroy_subscription(listener)
        bench.until(lambda: bench.node.count_subscribers("/risk_latched/risk/occupancy") == 0)
        before = len(bench.got["risk"])
        bench.node.set_parameters([Parameter("prediction_timeout", value=0.05)])
        bench.until(lambda: len(bench.got["risk"]) > before)
        late, heard = grids_heard_late(bench)
        bench.until(lambda: heard and set(heard[-1].data) == {-1})
        bench.peer.destroy_subscription(late)
    finally:
        bench.close()


def test_a_grid_is_not_left_behind_by_a_node_that_is_deactivated(bench):
    assert set(bench.grid_of(prediction()).data) != {-1}
    assert str(bench.node.trigger_deactivate()).endswith("SUCCESS")
    bench.until(lambda: set(bench.got["occupancy"][-1].data) == {-1})
    assert str(bench.node.trigger_activate()).endswith("SUCCESS")
    bench.until(lambda: bench.predictor.get_subscription_count() > 0)
    bench.until(lambda: bench.planner.get_subscription_count() > 0)


def test_a_grid_without_plan_and_road_users_stays_where_it_was():
    bench = RiskBench("/risk_placeless")
    try:
        bench.start()
        grid = bench.grid_of(prediction())
        assert max(grid.data) > 0
        empty = bench.grid_of(prediction(x=()))
        assert set(empty.data) == {0}
        assert empty.info.origin == grid.info.origin
    finally:
        bench.close()


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
