# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From a message to a published prediction, by direct calls of the subscription's callback."""

import dataclasses
import itertools
import queue
import time

import pytest
from geometry_msgs.msg import Pose, Quaternion
from nav_msgs.msg import Odometry
from rclpy.lifecycle import LifecycleNode
from ros_helpers import LIMIT_S, START_NS, RecordingLogger, message_of, traffic
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.registry import INPUTS
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.prediction.scene_predictor import PredictionReport
from mtpgo_core.schema import AgentClass, Source
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.frame_transform import NoTransform
from mtpgo_ros.node.inference.prediction_request import PredictionRequest
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.node.prediction_pipeline import PredictionPipeline
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.receipt_clock import Receipt

ADAPTER = INPUTS["pointcloud2"]
_namespaces = itertools.count()


class RecordingPublishers:
    """Keeps what would be published."""

    def __init__(self):
        self.predictions, self.times_ms = queue.Queue(), queue.Queue()

    def publish(self, prediction):
        self.predictions.put(prediction)

    def publish_secondary(self, _prediction, processing_time_ms):
        self.times_ms.put(processing_time_ms)


class Setup:
    """A pipeline without a model, fed by the test."""

    def __init__(self, **values):
        self.node = LifecycleNode("predictor", namespace=f"/pipeline{next(_namespaces)}")
        parameters = dataclasses.replace(
            PredictorParameters(), model="/none.pt", require_model=False, **values
        )
        self.logger, self.status = RecordingLogger(), NodeStatus()
        self.events, self.publishers = EventLog(self.logger), RecordingPublishers()
        self.model, self.parameters = ModelHost(parameters), parameters
        self.pipeline = self.again()

    def again(self):
        """Another activation."""
        return PredictionPipeline(
            self.node, self.model, self.publishers, self.parameters, self.events, self.status
        )

    def receive(self, message, received_ns=None, adapter=ADAPTER):
        received_ns = time.monotonic_ns() if received_ns is None else received_ns
        self.pipeline._on_objects(message, adapter, Receipt(received_ns))

    def prediction(self):
        prediction = self.publishers.predictions.get(timeout=LIMIT_S)
        self.publishers.times_ms.get(timeout=LIMIT_S)  # published last
        return prediction

    def close(self):
        assert self.pipeline.close()
        self.node.destroy_node()


@pytest.fixture
def make():
    made = []

    def make(**values):
        made.append(Setup(**values))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_an_observation_becomes_a_prediction_and_the_status_of_the_node(make):
    setup = make()
    assert not setup.pipeline.watch.age(1.0).usable
    assert setup.pipeline.idle_s() == float("inf")
    setup.receive(message_of(traffic(0.0, agents=3)))
    prediction = setup.prediction()
    assert (prediction.stamp_ns, prediction.frame_id, len(prediction)) == (START_NS, "map", 3)
    assert setup.events.counts() == {"messages": 1, "predictions": 1}
    status = setup.status
    assert (status.frame_id, status.agents, status.fallback_agents) == ("map", 3, 3)
    assert status.latency.summary().maximum > 0.0
    age = setup.pipeline.watch.age(1.0)
    assert age.usable
    assert 0.0 <= age.age_s < LIMIT_S
    assert 0.0 <= setup.pipeline.idle_s() < LIMIT_S
    assert setup.pipeline.unanswered_s() == 0.0


def test_markers_without_a_stamp_are_of_the_time_at_which_they_were_received(make):
    """Not at which they were decoded: what waited for that would have moved in no time."""
    setup = make(rate=20.0)
    for k in range(2):
        message = message_of(traffic(0.1 * k, agents=2), "markers")
        for marker in message.markers:
            marker.header.stamp.sec = marker.header.stamp.nanosec = 0
        waited_ns = (2 - k) * 100_000_000
        came_ns = setup.node.get_clock().now().nanoseconds - waited_ns
        setup.receive(message, time.monotonic_ns() - waited_ns, INPUTS["markers"])
        assert abs(setup.prediction().stamp_ns - came_ns) < 50_000_000


def test_the_trackers_ego_ends_when_the_odometry_begins(make):
    """Carried on it would be a road user at the place of the ego, which is not published."""
    setup = make(ego_topic="ego_odometry", ego_predicted=False)
    seen = []
    for k in range(4):
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id = "map"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            START_NS + k * 200_000_000, 10**9
        )
        message.pose.pose.position.x = 12.0 + 2.0 * k  # where the tracker has road user 2
        message.pose.pose.orientation.w = 1.0
        if k >= 2:
            setup.pipeline.ego._on_odometry(message)
        setup.receive(message_of(traffic(0.2 * k, agents=3)))
        seen.append(setup.prediction().key[:, 0].tolist())
    assert seen == [[1, 2, 3], [1, 2, 3], [1, 3], [1, 3]]


def test_nothing_is_learned_from_an_ego_that_is_not_published(make):
    """Its odometry is better than any tracker: the ellipses of the others would become small."""
    setup = make(ego_id="2", ego_predicted=False)
    setup.receive(message_of(traffic(0.0, agents=3)))
    assert setup.prediction().key[:, 0].tolist() == [1, 3]
    ((keys, _),) = setup.model.calibrator.live._matcher._waiting
    assert keys[:, 0].tolist() == [1, 3]


def test_objects_that_cannot_be_read_are_reported_with_the_reason(make):
    setup = make()
    sphere = Marker(type=Marker.SPHERE, pose=Pose(orientation=Quaternion(w=1.0)))
    setup.pipeline._read(MarkerArray(markers=[sphere, sphere]), INPUTS["markers"], START_NS)
    reason = "marker of type 2, neither CUBE nor CYLINDER"
    assert setup.logger.warnings == [f"objects that could not be read ({reason}): 2"]
    assert setup.events.recent(ODD_INPUT) == [
        f"objects that could not be read ({reason}; 2 in all)"
    ]


def test_another_frame_is_reported_with_both_names(make):
    setup = make()
    setup.receive(message_of(traffic(0.0)))
    setup.receive(message_of(traffic(0.2, frame_id="odom")))
    assert "messages in another frame ('odom', before 'map'; 1 in all)" in setup.events.recent(
        ODD_INPUT
    )


def test_what_cannot_be_read_is_counted_and_logged_with_the_reason(make):
    setup = make()
    message = message_of(traffic(0.0))
    message.data = message.data[:100]
    setup.receive(message)
    setup.receive("not a message")  # the second line of this kind is not logged yet
    age = setup.pipeline.watch.age(1.0)
    assert (age.usable, age.rejected, age.reason) == (False, 2, "messages that could not be read")
    assert setup.events.counts() == {"messages": 2, "malformed": 2}
    (line,) = setup.logger.warnings
    assert line.startswith(f"message on {setup.pipeline.objects.topic} left out: ")
    (said,) = setup.events.recent(ODD_INPUT)
    assert said.startswith("messages that could not be read (")
    assert said.endswith("; 2 in all)")


def test_an_unexpected_exception_is_counted_as_malformed(make):
    setup = make()
    setup.pipeline.transform = None
    setup.receive(message_of(traffic(0.0)))
    assert setup.events.counts() == {"messages": 1, "malformed": 1}
    assert "left out: AttributeError: " in setup.logger.warnings[0]
    setup.pipeline.transform = NoTransform()


def test_a_missing_pose_is_an_error_of_the_frame_until_it_is_there(make):
    setup = make(fixed_frame="odom")
    setup.receive(message_of(traffic(0.0, frame_id="base_link")))
    assert setup.events.counts() == {"messages": 1, "not_lifted": 1}
    assert "'base_link', expected 'odom'" in setup.status.frame_error
    assert setup.status.frame_error in setup.logger.warnings[0]
    setup.receive(message_of(traffic(0.2, frame_id="odom")))
    assert setup.prediction().frame_id == "odom"
    assert setup.status.frame_error == ""


@pytest.mark.parametrize("frame_id", ["base_link", "car1/base_link"])
def test_a_moving_frame_is_reported_and_still_predicted(make, frame_id):
    setup = make()
    setup.receive(message_of(traffic(0.0, frame_id=frame_id)))
    setup.prediction()
    (line,) = setup.logger.warnings
    assert f"'{frame_id}', which usually moves with the vehicle" in line
    assert setup.status.frame_problems == [line]
    setup.receive(message_of(traffic(0.2, frame_id="map")))
    assert setup.status.frame_problems == []


def test_a_late_prediction_is_published_and_counted_as_a_missed_deadline(make):
    setup = make(rate=5.0, budget=1.0)
    window = traffic_window(setup)
    received_ns = time.monotonic_ns() - 200_000_001
    request = PredictionRequest(window, START_NS, received_ns, 10**18, deadline_ns=200_000_000)
    setup.pipeline._publish(request, setup.pipeline._predict(window))
    assert len(setup.prediction()) == 4
    assert setup.events.counts() == {"predictions": 1, "deadline_misses": 1}
    (line,) = setup.logger.warnings
    assert line.startswith("deadline missed: a prediction came ")


def test_consecutive_cycles_over_budget_are_counted(make):
    setup = make()
    window = traffic_window(setup)
    for over_budget, expected in ((True, 1), (True, 2), (False, 0), (True, 1)):
        request = PredictionRequest(window, START_NS, 0, 1, 1, over_budget=over_budget)
        setup.pipeline._publish(request, setup.pipeline._predict(window))
        assert setup.status.over_budget_in_a_row == expected


def test_the_prediction_has_the_stamp_of_the_observation_not_of_the_window(make):
    setup = make()
    window = traffic_window(setup)
    request = PredictionRequest(window, START_NS - 100_000_000, 0, 1, 1)
    setup.pipeline._publish(request, setup.pipeline._predict(window))
    prediction = setup.prediction()
    assert prediction.stamp_ns == START_NS - 100_000_000
    assert prediction.time_s[0] == pytest.approx(0.3)


def test_the_budget_is_a_share_of_the_period(make):
    setup = make(rate=10.0, budget=0.5)
    request = setup.pipeline._request("window", START_NS, 7)
    assert (request.received_ns, request.budget_ns, request.deadline_ns) == (
        7,
        50_000_000,
        100_000_000,
    )


def test_the_models_report_is_counted(make):
    setup = make()
    setup.pipeline._model.predict = lambda window: "prediction"
    setup.pipeline._model.predictor.last_report = PredictionReport(unusable=2, over_limit=5)
    assert setup.pipeline._predict("window") == "prediction"
    assert setup.events.counts() == {"non_finite_output": 2, "agents_over_limit": 5}


def traffic_window(setup):
    """The window of four agents at START_NS, without starting a prediction."""
    setup.pipeline.history._history.update(traffic(0.0))
    window = setup.pipeline.history._history.window()
    assert (setup.pipeline._model.fallback(window).source == Source.CONSTANT_VELOCITY).all()
    return window


def test_a_class_map_reads_the_names_in_the_messages(make):
    message = message_of(traffic(0.0), "markers")
    for marker in message.markers:
        marker.text = "human.pedestrian.adult"
    for name, expected in (("", AgentClass.UNKNOWN), ("nuscenes", AgentClass.PEDESTRIAN)):
        states, _ = make(class_map=name).pipeline._read(message, INPUTS["markers"], START_NS)
        assert set(states.agent_class.tolist()) == {expected}


@pytest.mark.parametrize("frame_id", ["", "/map"])
def test_a_frame_that_no_tool_accepts_is_reported_and_still_predicted(make, frame_id):
    setup = make()
    setup.receive(message_of(traffic(0.0, frame_id=frame_id)))
    assert setup.prediction().frame_id == frame_id
    (line,) = setup.logger.warnings
    assert f"frame '{frame_id}', which neither TF nor displays accept" in line
    assert setup.status.frame_problems == [line]


def test_nothing_of_an_earlier_activation_is_reported(make):
    setup = make()
    status = setup.status
    status.over_budget_in_a_row = status.without_model_in_a_row = 7
    status.agents, status.fallback_agents, status.overload = 64, 64, "too many"
    assert setup.pipeline.close()
    again = setup.again()
    assert (status.over_budget_in_a_row, status.without_model_in_a_row) == (0, 0)
    assert (status.agents, status.fallback_agents, status.overload) == (0, 0, "")
    setup.pipeline = again
