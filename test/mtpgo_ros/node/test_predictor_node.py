# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node in normal operation, over DDS."""

import itertools
import sys
import types

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.time import Time as ClockTime
from ros_helpers import LATCHED, START_NS, message_of, parameters_of, traffic
from ros_stubs import install_tf2_ros
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.types import RclpyTypes
from mtpgo_core.prediction.paths.path_smoothing import KEEP_FACTOR
from mtpgo_core.schema import Source
from mtpgo_ros.node.history_input import LONGEST_DELAY_S

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def test_the_heaviest_mode_is_kept_unless_path_smoothing_is_off(bench):
    b = bench()
    first, second = (b.predict(traffic(time_s)).weight[0, 0] for time_s in (0.0, 0.2))
    assert [first, second] == pytest.approx([0.5, 0.5 * KEEP_FACTOR / (0.5 + 0.5 * KEEP_FACTOR)])
    b.node.set_parameters_atomically([_parameter("path_smoothing", 0.0)])
    assert b.predict(traffic(0.4)).weight[0, 0] == pytest.approx(0.5)


def test_every_agent_is_predicted_under_the_observations_stamp_and_frame(bench):
    b = bench(path_smoothing=0.0)
    times = []
    b.peer.create_subscription(
        Float64, "predictor/debug/processing_time_ms", lambda m: times.append(m.data), 20
    )
    # 25 Hz in, 5 Hz out: the observations at multiples of 0.2 s, and no others.
    for step in range(11):
        states = traffic(step / 25.0, agents=6, frame_id="odom")
        b.send(message_of(states))
        if step % 5 == 0:
            b.prediction(states.stamp_ns)
    b.answered(3)
    assert [p.stamp_ns - START_NS for p in b.predictions] == [0, 200_000_000, 400_000_000]
    last = b.predictions[-1]
    assert last.frame_id == "odom"
    assert last.key[:, 0].tolist() == [1, 2, 3, 4, 5, 6]
    assert (last.source == Source.MODEL).all()
    assert last.weight[0] == pytest.approx([0.5, 0.3, 0.2], abs=1e-6)
    assert last.time_s == pytest.approx(0.2 * np.arange(1, 26), abs=1e-5)
    # Agent i is at 12 i + 10 * 0.4 m and drives at 10 m/s.
    expected = 12.0 * np.arange(6)[:, None] + 4.0 + 10.0 * last.time_s
    assert last.mean[:, 0, :, 0] == pytest.approx(expected, abs=1e-3)
    assert last.covariance[0, 0, 4, 0, 0] == pytest.approx(0.1 + 1.0**2, abs=1e-4)
    b.until(lambda: len(times) > 0)
    assert all(time_ms > 0.0 for time_ms in times)
    b.status("model", OK, model="tiny", weights_sha256="0" * 64, agents="6")
    values = b.status("timing", OK, predictions="3", over_budget="0")
    assert 0.0 < float(values["latency_ms_p50"]) <= float(values["latency_ms_max"])


def test_markers_are_built_for_subscribers_only_and_stale_ones_are_deleted(bench):
    b = bench(max_modes=2)
    writers, built = b.node._outputs._writers, []
    writer = writers["markers"]  # exists, though there is no subscriber

    def counted(prediction):
        built.append(prediction)
        return writer(prediction)

    writers["markers"] = counted
    b.predict(traffic(0.0, agents=3))
    received = []
    b.peer.create_subscription(MarkerArray, "predictor/markers", received.append, 20)
    topic = b.namespace + "/predictor/markers"
    b.until(lambda: b.node.count_subscribers(topic) == 1 and b.peer.count_publishers(topic) == 1)
    b.until(lambda: b.node._outputs._publishers["markers"].get_subscription_count() == 1)
    assert not received
    b.predict(traffic(0.2, agents=3))
    b.until(lambda: len(received) == 1)
    assert len(built) == 1
    drawn = {(m.ns, m.id) for m in received[0].markers if m.action == Marker.ADD}
    assert drawn
    assert {m.header.stamp.nanosec for m in received[0].markers} == {200_000_000}
    # Agents 2 and 3 leave; after half a second they are no longer extrapolated.
    for step in (2, 3, 4, 5):
        b.predict(traffic(0.2 * step, agents=1))
    b.until(lambda: any(len(array.markers) for array in received[1:]))
    b.until(lambda: _alive(received) < drawn)
    alive = _alive(received)
    assert 0 < len(alive) <= len(drawn) // 2
    b.node.set_parameters_atomically([_parameter("output", ["pointcloud2"])])
    b.until(lambda: received[-1].markers[0].action == Marker.DELETEALL)


def _alive(arrays):
    """Return the markers that a display would show after these arrays."""
    alive = set()
    for array in arrays:
        for marker in array.markers:
            if marker.action == Marker.ADD:
                alive.add((marker.ns, marker.id))
            elif marker.action == Marker.DELETE:
                alive.discard((marker.ns, marker.id))
    return alive


def _parameter(name, value):
    from rclpy.parameter import Parameter

    return Parameter(name, value=value)


def test_life_cycle_by_services(bench):
    b = bench()

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return b.call(ChangeState, "change_state", request).success

    def state():
        return b.call(GetState, "get_state", GetState.Request()).current_state.id

    assert state() == State.PRIMARY_STATE_ACTIVE
    b.predict(traffic(0.0))
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert state() == State.PRIMARY_STATE_INACTIVE
    b.status("input", WARN, "not active")
    b.until(lambda: b.objects.get_subscription_count() == 0)
    assert change(Transition.TRANSITION_CLEANUP)
    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    # A missing model leaves the node unconfigured, and the parameter can be corrected.
    good = b.node.parameters.model
    answer = b.call(
        SetParameters,
        "set_parameters",
        SetParameters.Request(parameters=parameters_of({"model": "/no/such/model.pt"})),
    )
    assert answer.results[0].successful
    assert not change(Transition.TRANSITION_CONFIGURE)
    assert "/no/such/model.pt" in b.node.failure
    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    b.node.set_parameters_atomically([_parameter("model", good)])
    assert change(Transition.TRANSITION_CONFIGURE)
    assert change(Transition.TRANSITION_ACTIVATE)
    b.until(lambda: b.objects.get_subscription_count() == 1)
    b.until(lambda: b.node._pipeline.objects._subscription.get_publisher_count() == 1)
    assert len(b.predict(traffic(10.0))) == 4
    assert change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state() == State.PRIMARY_STATE_FINALIZED


def test_parameters_by_services(bench):
    b = bench(input_timeout=1.0)

    def set_together(**values):
        request = SetParametersAtomically.Request(parameters=parameters_of(values))
        return b.call(SetParametersAtomically, "set_parameters_atomically", request).result

    # A set that is not allowed as a whole changes nothing.
    answer = set_together(max_modes=1, rate=0.5)
    assert not answer.successful
    assert "input_timeout" in answer.reason
    assert b.node.parameters.max_modes == 8
    assert set_together(max_modes=1, rate=0.5, input_timeout=5.0).successful
    assert b.node.parameters.rate == 0.5
    assert b.predict(traffic(0.0)).weight.shape == (4, 1)
    answer = set_together(model="other")
    assert not answer.successful
    assert "unconfigured" in answer.reason
    assert set_together(rate=4, ego_id=17).successful  # whole numbers, as a command line gives
    assert (b.node.parameters.rate, b.node.parameters.ego_id) == (4.0, "17")
    request = DescribeParameters.Request(names=["rate", "autostart", "graph", "max_agents"])
    rate, autostart, graph, agents = b.call(
        DescribeParameters, "describe_parameters", request
    ).descriptors
    assert (rate.floating_point_range[0].from_value, rate.description != "") == (0.1, True)
    assert (agents.integer_range[0].from_value, autostart.read_only) == (1, True)
    assert "'cover'" in graph.additional_constraints


def test_objects_in_the_vehicles_frame_are_transformed_by_odometry(bench):
    b = bench(fixed_frame="odom")
    odometry = b.peer.create_publisher(Odometry, "odometry", 10)
    b.until(lambda: odometry.get_subscription_count() == 1)
    states = traffic(0.0, agents=2, frame_id="base_link")
    b.send(message_of(states))
    b.status("input", ERROR, "base_link", not_lifted="1")
    # The vehicle drives north (along y) at 5 m/s; at 0.1 s it has moved half a metre.
    for time_ns in (0, 200_000_000):
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id = "odom"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(START_NS + time_ns, 10**9)
        message.pose.pose.position.x = 100.0
        message.pose.pose.position.y = 5.0 * time_ns * 1e-9
        message.pose.pose.orientation.z = message.pose.pose.orientation.w = np.sqrt(0.5)
        message.twist.twist.linear.x = 5.0
        odometry.publish(message)
    poses = b.node._pipeline.transform._poses
    b.until(lambda: sum(map(len, poses.values())) == 2)
    prediction = b.predict(traffic(0.1, agents=2, frame_id="base_link"))
    assert prediction.frame_id == "odom"
    # Agent 2, at 12 + 1 m ahead, moving ahead at 10 m/s: in odom it moves along y.
    reached = 0.5 + 13.0 + 10.0 * prediction.time_s
    assert prediction.mean[1, 0, :, 1] == pytest.approx(reached, abs=1e-3)
    assert prediction.mean[1, 0, :, 0] == pytest.approx(np.full(25, 100.0), abs=1e-3)
    assert b.node._status.frame_error == ""
    b.status("input", WARN, "transformed")
    # An empty message names no frame.
    assert b.predict(traffic(0.3, agents=0, frame_id="")).frame_id == "odom"
    assert b.count("not_lifted") == 1


def test_tf_is_used_where_it_is_installed(bench, monkeypatch):
    """tf2 is not on pip: a stub replaces the calls that the node makes."""
    asked = []

    class Buffer:
        def lookup_transform(self, target, source, when):
            asked.append((target, source, when.nanoseconds))
            if when.nanoseconds == START_NS:
                raise LookupError("extrapolation into the past")
            transform = TransformStamped()
            transform.transform.translation.x = 100.0
            transform.transform.rotation.z = transform.transform.rotation.w = np.sqrt(0.5)
            return transform

    class TransformListener:
        def __init__(self, buffer, node, *, spin_thread):
            assert isinstance(buffer, Buffer)

        def unregister(self):
            asked.append("closed")

    module = types.SimpleNamespace(Buffer=Buffer, TransformListener=TransformListener)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)
    b = bench(fixed_frame="map")
    b.send(message_of(traffic(0.0, agents=1, frame_id="base_link")))
    b.status("input", ERROR, "extrapolation into the past")
    prediction = b.predict(traffic(0.2, agents=1, frame_id="base_link"))
    assert prediction.mean[0, 0, :, 0] == pytest.approx(np.full(25, 100.0), abs=1e-3)
    assert prediction.mean[0, 0, :, 1] == pytest.approx(2.0 + 10.0 * prediction.time_s, abs=1e-3)
    b.node.stop()
    assert asked == [
        ("map", "base_link", START_NS),
        ("map", "base_link", START_NS + 200_000_000),
        "closed",
    ]


def test_lane_markings_come_latched_to_a_model_that_wants_them(bench):
    b = bench("lanes")
    assert len(b.predict(traffic(0.0))) == 4
    b.status("model", WARN, "lane_markings")
    lines = [np.array([[-100.0, y], [500.0, y]]) for y in (2.0, -2.0)]
    publisher = b.peer.create_publisher(MarkerArray, "lane_markings", LATCHED)
    publisher.publish(lanes_to_markers(lines, RclpyTypes(), stamp_ns=0, frame_id="map"))
    b.until(lambda: len(b.node._model.predictor.lanes) == 2)
    assert len(b.predict(traffic(0.2))) == 4
    b.status("model", OK)


def test_lanes_come_from_a_file_that_may_change(bench, tmp_path):
    def lane_file(name, x, y):
        lines = [[[x - 100.0, y + side], [x + 500.0, y + side]] for side in (2.0, -2.0)]
        text = f'{{"type": "MultiLineString", "coordinates": {lines}}}'
        (tmp_path / name).write_text(text)
        return str(tmp_path / name)

    path = lane_file("lanes.geojson", 0.0, 1.0)
    b = bench("lanes", lane_file=path)
    assert b.peer.count_subscribers(f"{b.namespace}/lane_markings") == 0
    assert len(b.predict(traffic(0.0))) == 4
    b.status("model", OK, lanes=path, lane_segments="2", in_lane="1.00")
    refused = b.node.set_parameters([Parameter("lane_file", value="/none.osm")])[0]
    assert "parameter lane_file: /none.osm cannot be read" in refused.reason
    far = lane_file("far.geojson", 30_000.0, 0.0)
    assert b.node.set_parameters([Parameter("lane_file", value=far)])[0].successful
    b.node._model.lanes._reader.join(30.0)
    b.predict(traffic(0.2))
    b.status("model", WARN, "no lane line within 1 km")
    assert b.node.set_parameters([Parameter("lane_offset", value="30000,1")])[0].successful
    b.node._model.lanes._reader.join(30.0)
    b.predict(traffic(0.4))
    b.status("model", OK)
    assert b.node.set_parameters([Parameter("lane_file", value="")])[0].successful
    b.status("model", WARN, "nothing has come on lane_markings")
    assert b.peer.count_subscribers(f"{b.namespace}/lane_markings") == 1


def test_lanes_are_compared_with_what_the_history_knows_of_the_traffic(bench, tmp_path):
    """A tracker need not give velocities, and an object without a place is none."""
    lines = [[[500.0, side], [-100.0, side]] for side in (2.0, -2.0)]  # against the traffic
    path = tmp_path / "against.geojson"
    path.write_text(f'{{"type": "MultiLineString", "coordinates": {lines}}}')
    b = bench("lanes", lane_file=str(path))
    b.node._model.lanes._clock = itertools.count(step=2).__next__
    for k in range(3):
        states = traffic(0.2 * k, agents=20)
        states.velocity[:] = states.position[19] = np.nan
        assert len(b.predict(states)) == 19
    b.status("model", WARN, "no vehicle that moves is in a lane", lane_distance_m="2")


def test_a_lane_file_that_cannot_be_used_refuses_the_configuration(bench, tmp_path):
    (tmp_path / "lanes.osm").write_text("<osm/>")
    b = bench("lanes", started=False, lane_file=str(tmp_path / "lanes.osm"))
    assert str(b.node.trigger_configure()).endswith("FAILURE")
    assert "lanes.osm has no lanelet" in b.node.failure


def test_the_ego_comes_by_topic_and_a_missing_one_is_reported(bench):
    b = bench(graph="ego")
    b.predict(traffic(0.0))
    b.status("model", WARN, "no ego")
    publisher = b.peer.create_publisher(String, "ego_id", LATCHED)
    publisher.publish(String(data="3"))
    b.until(lambda: b.node._pipeline.ego_text == "3")
    b.predict(traffic(0.2))
    b.status("model", OK)
    assert b.node._model._ego_key.tolist() == [3, 0, 0, 0]


def test_delay_compensation_shifts_the_horizon_and_keeps_the_stamp(bench):
    b = bench(delay_compensation=True, stamp_tolerance=3600.0)

    def live():
        """Return the prediction of an observation that is a tenth of a second old."""
        now_ns = b.node.get_clock().now().nanoseconds - 100_000_000
        b.node._pipeline.history.reset()
        states = traffic(0.0, agents=2)
        return b.predict(type(states)(**{**vars(states), "stamp_ns": now_ns}))

    begin_ns = b.node.get_clock().now().nanoseconds
    prediction = live()
    while b.count("delay_not_compensated"):  # a busy machine took too long
        b.node.events.reset()
        begin_ns = b.node.get_clock().now().nanoseconds
        prediction = live()
    delay_s = prediction.time_s[0] - 0.2
    took_s = 1e-9 * (b.node.get_clock().now().nanoseconds - begin_ns)
    assert 0.1 <= delay_s < min(0.1 + took_s, LONGEST_DELAY_S)
    assert prediction.mean[0, 0, :, 0] == pytest.approx(10.0 * prediction.time_s, abs=1e-3)
    # An old recording without its clock cannot be compensated; it is predicted all the same.
    b.node._pipeline.history.reset()
    assert b.predict(traffic(0.0)).time_s[0] == pytest.approx(0.2, abs=1e-6)
    assert b.count("delay_not_compensated") == 1


def test_stale_input_is_an_error(bench):
    b = bench(input_timeout=0.3)
    b.status("input", WARN, "nothing has come")
    b.predict(traffic(0.0))
    b.status("input", ERROR, "stale")


def test_simulated_time_and_its_jump_back(bench):
    b = bench(use_sim_time=True)
    clock = b.peer.create_publisher(Clock, "/clock", 10)
    b.until(lambda: clock.get_subscription_count() >= 1)

    def tick(time_s):
        stamp_ns = traffic(time_s).stamp_ns

        def arrived():
            clock.publish(Clock(clock=Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)))
            b.executor.spin_once(timeout_sec=0.02)
            return b.node.get_clock().now().nanoseconds == stamp_ns

        b.until(arrived)

    tick(100.0)
    b.predict(traffic(100.0))
    # Stamps are compared with the simulated time, not with the machine's.
    b.send(message_of(traffic(200.0)))
    assert b.count("future_stamp") == 1
    tick(10.0)  # the bag starts again: the history is cleared before its first message
    assert b.count("clock_reset") == 1
    assert len(b.predict(traffic(10.0))) == 4
    assert b.count("clock_reset") == 1


def test_poses_of_the_time_before_a_jump_back_are_forgotten(bench, monkeypatch):
    buffers = install_tf2_ros(monkeypatch)
    b = bench(fixed_frame="map", use_sim_time=True)

    def tick(time_s):
        now_ns = traffic(time_s).stamp_ns
        b.node.get_clock().set_ros_time_override(ClockTime(nanoseconds=now_ns))

    tick(100.0)
    b.predict(traffic(100.0))
    assert [one.cleared for one in buffers] == [0]
    tick(99.99)  # only jitter
    assert [one.cleared for one in buffers] == [0]
    tick(10.0)
    assert [one.cleared for one in buffers] == [1]
    b.predict(traffic(10.0))
    for step in range(3):  # the clock of the observations alone is set back
        b.send(message_of(traffic(5.0 + 0.1 * step)))
    assert b.count("clock_reset") == 2
    assert [one.cleared for one in buffers] == [2]
