# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Odd input over DDS: each kind has its outcome and its counter, and the node keeps predicting."""

import dataclasses
import itertools

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from ros_helpers import START_NS, message_of, traffic
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, Source

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def changed(states, **values):
    return dataclasses.replace(states, **values)


def spoilt(states, name, row, value):
    array = getattr(states, name).copy()
    array[row] = value
    return changed(states, **{name: array})


@pytest.fixture
def predicting(bench):
    """A bench that has predicted four agents at time zero."""
    b = bench()
    b.predict(traffic(0.0))
    return b


def still_predicts(b, time_s, agents=4):
    """Check that the model predicts all agents of the next observation."""
    prediction = b.predict(traffic(time_s, agents=agents))
    assert len(prediction) == agents
    assert (prediction.source == Source.MODEL).all()
    assert np.isfinite(prediction.mean).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_position_that_is_not_finite_leaves_that_agent_out(predicting, value):
    b = predicting
    prediction = b.predict(spoilt(traffic(0.2, agents=6), "position", 4, value))
    # Agent 5 never had a position; the others are predicted, the sixth with one sample.
    assert prediction.key[:, 0].tolist() == [1, 2, 3, 4, 6]
    assert np.isfinite(prediction.mean).all()
    assert b.count("non_finite") == 1
    b.status("input", WARN, "without a finite position", non_finite="1")
    still_predicts(b, 0.4, agents=6)


@pytest.mark.parametrize("name", ["velocity", "acceleration", "yaw", "size", "covariance", "z"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_other_fields_that_are_not_finite_are_estimated(predicting, name, value):
    b = predicting
    states = traffic(0.2)
    prediction = b.predict(spoilt(states, name, slice(None), value))
    assert len(prediction) == 4
    assert np.isfinite(prediction.mean).all()
    # Moved 2 m in 0.2 s: the velocity is estimated where it is missing.
    assert prediction.mean[:, 0, 0, 2] == pytest.approx(np.full(4, 10.0), abs=0.5)
    still_predicts(b, 0.4)


def test_an_absurd_speed_is_rejected(predicting):
    b = predicting
    prediction = b.predict(spoilt(traffic(0.2), "velocity", 0, 5000.0))
    assert len(prediction) == 4  # the first agent is extrapolated from its last observation
    assert prediction.mean[0, 0, 0, 0] == pytest.approx(4.0, abs=1e-3)
    assert b.count("too_fast") == 1


def test_velocities_and_headings_of_another_unit_are_noticed(bench):
    b = bench()
    for step in range(90):
        states = traffic(0.2 * step)
        b.predict(changed(states, velocity=3.6 * states.velocity, yaw=states.yaw + np.pi / 2))
    b.status("input", WARN, "velocities of the road users do not fit their movement in 100 %")
    b.status("input", WARN, "3.6 times as large in the mean")
    b.status("input", WARN, "headings of the road users do not fit their movement in 100 %")
    # Another frame of the velocities begins anew, and what comes now fits.
    b.node.set_parameters_atomically([_parameter("twist_frame", "header")])
    for step in range(90, 180):
        b.predict(traffic(0.2 * step))
    b.status("input", OK, "receiving")


def test_identities_that_do_not_last_are_noticed(bench):
    b = bench()
    for step in range(60):
        key = keys_from_integers(np.arange(4) + 4 * step)
        b.predict(changed(traffic(0.2 * step), key=key))
    b.status("input", WARN, "100 % of the road users have no past: their identities do not last")
    for step in range(60, 120):
        b.predict(traffic(0.2 * step))
    b.status("input", OK, "receiving")


def test_a_tracker_that_is_too_slow_is_noticed(bench):
    b = bench()
    for step in range(12):
        b.predict(traffic(1.0 * step))
    b.status("input", WARN, "no past: the objects come every 1 s, and the history bridges 0.5 s")


def test_positions_in_degrees_are_noticed(bench):
    b = bench()
    for step in range(60):
        states = traffic(0.2 * step)
        position = 1e-5 * states.position + [8.5, 49.0]
        b.predict(changed(states, position=position, velocity=1e-5 * states.velocity))
    b.status("input", WARN, "4 road users at a time are within 0.00")


def test_unknown_classes_are_predicted_as_unknown(predicting):
    b = predicting
    prediction = b.predict(spoilt(traffic(0.2), "agent_class", slice(None), 200))
    assert len(prediction) == 4
    # Known agents keep their last known class; new ones are unknown.
    fresh = b.predict(spoilt(traffic(0.4, agents=5), "agent_class", slice(None), 77))
    assert fresh.agent_class.tolist() == [AgentClass.CAR] * 4 + [AgentClass.UNKNOWN]
    assert b.count("unknown_class") == 9


def test_an_empty_array_advances_the_time(predicting):
    b = predicting
    prediction = b.predict(traffic(0.2, agents=0))
    assert len(prediction) == 4  # extrapolated for half a second
    prediction = b.predict(traffic(0.8, agents=0))
    assert len(prediction) == 0  # published nevertheless: the scene is known to be empty
    assert b.count("empty_messages") == 2
    still_predicts(b, 1.0)


def test_empty_from_the_start(bench):
    b = bench()
    assert len(b.predict(traffic(0.0, agents=0))) == 0


def test_a_thousand_objects_are_all_predicted(bench):
    b = bench(max_agents=100, max_modes=1)
    prediction = b.predict(traffic(0.0, agents=1000))
    assert len(prediction) == 1000
    assert np.isfinite(prediction.mean).all()
    assert (prediction.source == Source.MODEL).sum() == 100
    assert b.count("agents_over_limit") == 900
    b.status("model", WARN, "nearest 100 of 1000")
    # The same with all modes: 12.5 MB in one message.
    b.node.set_parameters_atomically([_parameter("max_modes", 8)])
    assert len(b.predict(traffic(0.2, agents=1000))) == 1000
    still_predicts(b, 1.0)


def _parameter(name, value):
    from rclpy.parameter import Parameter

    return Parameter(name, value=value)


def test_a_repeated_message_starts_nothing(predicting):
    b = predicting
    b.send(message_of(traffic(0.0)))
    assert b.count("duplicates") == 4
    still_predicts(b, 0.2)
    b.answered(2)


def test_older_stamps_start_nothing(predicting):
    b = predicting
    still_predicts(b, 0.2)
    b.send(message_of(traffic(0.1)))
    b.send(message_of(traffic(-0.2)))
    assert b.count("late") == 8
    still_predicts(b, 0.4)
    b.answered(3)
    assert b.count("clock_reset") == 0


def test_a_jump_back_in_time_clears_the_history(predicting):
    b = predicting
    still_predicts(b, 10.0)
    prediction = b.predict(traffic(1.0))  # the bag has looped
    assert len(prediction) == 4
    assert b.count("clock_reset") == 1
    b.status("input", WARN, "backwards")
    still_predicts(b, 1.2)


def test_one_stamp_from_the_future_is_dropped(bench):
    b = bench()
    now_ns = b.node.get_clock().now().nanoseconds

    def live(time_s):
        return changed(traffic(time_s), stamp_ns=now_ns + round(time_s * 1e9))

    b.predict(live(0.0))
    b.send(message_of(live(3600.0)))
    assert b.count("future_stamp") == 1
    assert len(b.predict(live(0.2))) == 4
    b.answered(2)
    # A stream that stays ahead has another clock: it is accepted from its third message on.
    for step in range(4):
        b.send(message_of(live(3600.0 + 0.2 * step)))
    b.prediction(live(3600.6).stamp_ns)
    b.status("input", WARN, "ahead of the clock")


def test_a_message_without_a_stamp_is_dropped(predicting):
    b = predicting
    b.send(message_of(changed(traffic(0.2), stamp_ns=0)))
    assert b.count("unstamped") == 1
    still_predicts(b, 0.4)
    assert b.count("clock_reset") == 0


def test_one_message_in_another_frame_is_rejected(predicting):
    b = predicting
    b.send(message_of(traffic(0.2, frame_id="base_link")))
    assert (b.count("frame_changed"), b.count("wrong_frame")) == (1, 4)
    still_predicts(b, 0.4)
    # A stream that stays in its new frame starts a new history there.
    for step in range(3):
        b.send(message_of(traffic(0.6 + 0.2 * step, frame_id="odom")))
    prediction = b.prediction(traffic(1.0).stamp_ns)
    assert prediction.frame_id == "odom"
    assert len(prediction) == 4


@pytest.mark.parametrize(
    "fields",
    [[], [PointField(name="x", offset=0, datatype=PointField.FLOAT32, count=1)]],
    ids=["no fields", "x only"],
)
def test_a_cloud_of_something_else_is_left_out(predicting, fields):
    b = predicting
    b.send(PointCloud2(fields=fields, width=3, height=1, point_step=4, row_step=12))
    assert b.count("malformed") == 1
    b.status("input", WARN, "could not be read")
    still_predicts(b, 0.2)


def test_a_cloud_that_is_cut_off_is_left_out(predicting):
    b = predicting
    message = message_of(traffic(0.2))
    message.data = message.data[: len(message.data) // 2]
    b.send(message)
    assert b.count("malformed") == 1
    still_predicts(b, 0.4)


def test_objects_as_markers_are_recognised_by_their_type(bench):
    b = bench(objects_type=MarkerArray)
    b.send(message_of(traffic(0.0), "markers"))
    b.send(message_of(traffic(0.2), "markers"))
    prediction = b.prediction(traffic(0.2).stamp_ns)
    assert len(prediction) == 4
    assert prediction.mean[:, 0, 0, 2] == pytest.approx(np.full(4, 10.0), abs=0.5)
    assert b.node._pipeline.objects.message_type == "visualization_msgs/msg/MarkerArray"


def test_a_type_without_objects_is_reported(bench):
    b = bench(objects_type=None)
    publisher = b.peer.create_publisher(String, "objects", 1)
    b.status("input", WARN, "std_msgs/msg/String")
    # A publisher with a known type replaces it.
    b.peer.destroy_publisher(publisher)
    b.objects = b.peer.create_publisher(PointCloud2, "objects", 5)
    b.until(lambda: b.objects.get_subscription_count() == 1)
    b.until(lambda: b.node._pipeline.objects._subscription.get_publisher_count() == 1)
    b.predict(traffic(0.0))


def test_an_input_type_that_is_not_installed_names_the_package(bench):
    b = bench(started=False, input_type="autoware")
    assert str(b.node.trigger_configure()).endswith("SUCCESS")
    assert str(b.node.trigger_activate()).endswith("FAILURE")
    assert "ros-jazzy-autoware-perception-msgs" in b.node.failure


def test_an_output_that_is_not_installed_is_left_out(bench):
    b = bench(output=["pointcloud2", "autoware"])
    assert len(b.predict(traffic(0.0))) == 4


def test_constant_velocity_answers_for_a_model_over_its_budget(bench):
    b = bench("slow", budget=0.05, patient=False)  # ten milliseconds
    prediction = b.predict(traffic(0.0, speed_mps=20.0))
    assert (prediction.source == Source.CONSTANT_VELOCITY).all()
    reached = 12.0 * np.arange(4)[:, None] + 20.0 * prediction.time_s
    assert prediction.mean[:, 0, :, 0] == pytest.approx(reached, abs=1e-3)
    b.status("timing", WARN, "over budget", over_budget="1")
    # On a busy machine the budget may end before the model begins, and then no result is late.
    steps = 0
    while not b.comes_true(lambda: b.count("late_results_dropped") > 0, 3.0):
        steps += 1
        assert steps < 12, "the model never began within its budget"
        b.predict(traffic(0.2 * steps, speed_mps=20.0))
    # With enough time the model predicts again.
    b.be_patient()
    b.predict(traffic(5.0, speed_mps=0.0))
    assert (b.predictions[-1].source == Source.MODEL).all()
    stamps = [START_NS + round(0.2e9 * step) for step in range(steps + 1)]
    assert [p.stamp_ns for p in b.predictions] == [*stamps, START_NS + 5_000_000_000]


def test_a_model_that_never_keeps_up_is_an_error(bench):
    b = bench("slow", rate=50.0, patient=False)
    steps = itertools.count()

    def said():
        """Return whether four predictions are followed by the error; it ends with the stream."""
        for _ in range(4):
            b.predict(traffic(0.02 * next(steps), speed_mps=20.0))
        assert (b.predictions[-1].source == Source.CONSTANT_VELOCITY).all()
        return b.comes_true(
            lambda: (
                b.statuses["timing"].level == ERROR
                and "does not keep up" in b.statuses["timing"].message
            ),
            1.0,
        )

    b.until(said)


def test_constant_velocity_replaces_output_that_is_not_finite(bench):
    b = bench("poison")
    states = spoilt(traffic(0.0), "velocity", 1, (90.0, 0.0))
    prediction = b.predict(states)
    wanted = [Source.MODEL, Source.CONSTANT_VELOCITY, Source.MODEL, Source.MODEL]
    assert prediction.source.tolist() == wanted
    assert np.isfinite(prediction.mean).all()
    b.status("model", WARN, "not finite", non_finite_output="1", fallback_agents="1")


def test_without_a_model_all_agents_get_constant_velocity(bench):
    b = bench("/no/such/model.pt", require_model=False)
    prediction = b.predict(traffic(0.0))
    assert (prediction.source == Source.CONSTANT_VELOCITY).all()
    b.status("model", ERROR, "/no/such/model.pt", fallback_agents="4")
