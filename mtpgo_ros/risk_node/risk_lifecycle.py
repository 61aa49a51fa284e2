# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``risk``: subscriptions, publishers and diagnostics."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from msg_adapters.inputs.ego_plans import PLANS, PlanAdapter
from msg_adapters.predictions.prediction_messages import PREDICTIONS, PredictionAdapter
from msg_adapters.types import message_class
from mtpgo_core.errors import MtpgoError
from mtpgo_core.history.stream_guard import LATE_NS
from mtpgo_core.schema import Prediction
from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.input_watch import InputWatch
from mtpgo_ros.lifecycle.lifecycle_answers import state_of
from mtpgo_ros.lifecycle.new_entities import nothing_left_behind
from mtpgo_ros.lifecycle.own_topics import refuse_own_topics
from mtpgo_ros.lifecycle.recorded_transition import record_failure
from mtpgo_ros.lifecycle.resource_node import ResourceNode
from mtpgo_ros.node.context_subscriptions import ContextSubscriptions
from mtpgo_ros.parameters.parameter_server import ParameterServer
from mtpgo_ros.parameters.risk_parameters import RiskParameters, updated_risk
from mtpgo_ros.risk_node.plan_transform import PlanTransform
from mtpgo_ros.risk_node.publisher_check import publisher_problem
from mtpgo_ros.risk_node.risk_assessor import RiskAssessor
from mtpgo_ros.risk_node.risk_publishers import RiskPublishers
from mtpgo_ros.risk_node.risk_status import RiskStatus, risk_statuses
from mtpgo_ros.runtime.clock_watch import ClockSteps

_NEWEST = QoSProfile(depth=1)
_ANY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Fits every publisher of plans and odometry."""

_CHECK_PERIOD_S = 0.1
"""Time between two looks for predictions that no longer come (s); chosen."""

_PUBLISHERS_PERIOD_S = 0.5
"""Time between two looks at the publishers of both topics (s); chosen."""


class RiskNode(ResourceNode):
    """Publishes the risk of predicted road users for the plan of the ego.

    Args:
        arguments: of the process, to find out where unknown parameters come from.
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
        events: where everything unusual is counted and logged.

    Raises:
        ConfigurationError: a parameter has a value that is not allowed.
    """

    def __init__(self, *, arguments: Sequence[str] = (), **node_options: Any) -> None:
        super().__init__("risk", **node_options)
        self._outputs: RiskPublishers | None = None
        self._assessor: RiskAssessor | None = None
        self._inputs: list[Subscription] = []
        self._ego: ContextSubscriptions | None = None
        self._transform: PlanTransform | None = None
        self._watch = InputWatch()
        self._clock_steps = ClockSteps()
        self._last: Prediction | None = None
        self._checked_s = float("-inf")
        self._server = ParameterServer(
            self,
            RiskParameters(),
            updated_risk,
            may_reconfigure=lambda: self._outputs is None,
            on_change=self._on_parameters,
            arguments=arguments,
        )
        self._status = RiskStatus()
        self._diagnostics = DiagnosticsPublisher(
            self, self.events, self._current_status, risk_statuses
        )
        self._diagnostics.set_period(self.parameters.diagnostic_period)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(_CHECK_PERIOD_S, self._expire, clock=steady)
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-LATE_NS)),
            post_callback=lambda _jump: self._on_clock_set_back(),
        )

    @property
    def parameters(self) -> RiskParameters:
        """The current parameters."""
        return self._server.value

    @record_failure
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the types of predictions and plan and create the publishers."""
        message_class(self._prediction_adapter.message_type)
        message_class(self._plan_adapter.message_type)
        self.events.reset()
        with nothing_left_behind(self):
            self._outputs = RiskPublishers(self, self.parameters, self._status, self.events)
        return super().on_configure(state)

    @record_failure
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe."""
        adapter, predictions = self._plan_adapter, self._prediction_adapter
        parameters, status = self.parameters, self._status
        status.start_anew()
        status.topic = self.resolve_topic_name(predictions.topic)
        status.plan_topic = self.resolve_topic_name(adapter.topic)
        refuse_own_topics(
            self,
            {
                predictions.topic: predictions.message_type,
                adapter.topic: adapter.message_type,
                "ego_id": "std_msgs/msg/String",
            },
        )
        self._transform = PlanTransform(self)
        self._assessor = RiskAssessor(parameters, status, status.plan_topic, self._transform.pose)
        self._last, self._checked_s = None, float("-inf")
        self._clock_steps = ClockSteps()
        self._watch.start()
        with nothing_left_behind(self):
            self._ego = ContextSubscriptions(self, self._assessor.set_ego, None, self.events)
            self._inputs = [
                self.create_subscription(
                    message_class(predictions.message_type),
                    predictions.topic,
                    self._on_predictions,
                    _NEWEST,
                    raw=True,
                ),
                self.create_subscription(
                    message_class(adapter.message_type),
                    adapter.topic,
                    self._on_plan,
                    _ANY,
                    raw=True,
                ),
            ]
        done = self._activated(state)
        self.get_logger().info(
            f"ready: waiting for predictions on {status.topic} and {adapter.message_type} on"
            f" {status.plan_topic}"
        )
        return done

    @property
    def _prediction_adapter(self) -> PredictionAdapter:
        return PREDICTIONS[self.parameters.prediction_type]

    @property
    def _plan_adapter(self) -> PlanAdapter:
        return PLANS[self.parameters.plan_type]

    def _close(self) -> bool:
        if self._outputs is not None:
            self._outputs.withdraw_grid()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._inputs = []
        if self._ego is not None:
            self._ego.close()
        if self._transform is not None:
            self._transform.close()
        self._ego = self._transform = self._assessor = self._last = None
        return True

    def _release(self) -> None:
        if self._outputs is not None:
            self._outputs.close()
        self._outputs = None

    def _on_parameters(self, parameters: RiskParameters) -> None:
        self._diagnostics.set_period(parameters.diagnostic_period)
        if self._outputs is not None:
            self._outputs.configure(parameters)
        if self._assessor is not None:
            self._assessor.configure(parameters)

    def _on_clock_set_back(self) -> None:
        """Forget what belongs to another time; also called when another clock is used."""
        if self._transform is not None:
            self._transform.clear()
        if self._assessor is not None:
            self._assessor.forget_plans()

    def _notice_clock(self) -> None:
        """Forget what is of another time when the machine's clock was set."""
        if self._clock_steps.change_ns() and self._simulated_ns() is None:
            self._on_clock_set_back()

    def _on_plan(self, data: bytes) -> None:
        if self._assessor is None:
            return
        self._notice_clock()
        self.events.count("plans")
        adapter, stands_after = self._plan_adapter, self.parameters.stands_after
        try:
            adapter.check_serialized(data)
            message = deserialize_message(data, message_class(adapter.message_type))
            self._assessor.add_plan(adapter.plan(message, stands_after=stands_after))
        except Exception as error:  # rclpy's errors have no common base.
            self._assessor.refuse_plan(error)
            self.events.count("rejected_plans", reason=self._status.plan_problem)

    def _on_predictions(self, data: bytes) -> None:
        if self._assessor is None or self._outputs is None:
            return
        self._notice_clock()
        self.events.count("messages")
        try:
            assumes = self.parameters.assumes_covariance
            prediction = self._assessor.others(self._prediction_adapter.read(data, assumes))
            risk = self._assessor.assess(prediction, self.get_clock().now().nanoseconds)
            self._outputs.publish(risk, self._assessor.plan)
        except Exception as error:  # Whatever a message contains, the node keeps running.
            kind = "" if isinstance(error, MtpgoError) else f"{type(error).__name__}: "
            sentence = f"predictions on {self._status.topic} are not usable: {kind}{error}"
            self._status.prediction_problem = sentence
            self._watch.reject(str(error))
            self.events.count("rejected", reason=sentence)
            return
        self._watch.accept()
        self._last = None if self._status.prediction_problem else prediction
        known = not self._status.prediction_problem
        self._outputs.publish_grid(prediction, self._assessor.place(prediction), known=known)
        status = self._status
        problems = (status.prediction_problem, status.prediction_warning, status.plan_problem)
        for problem in problems:
            if problem:
                self.events.log("unknown risk", problem)

    def _expire(self) -> None:
        """Publish once that the risk is unknown when no predictions come any more."""
        prediction, assessor, outputs = self._last, self._assessor, self._outputs
        if prediction is None or assessor is None or outputs is None:
            return
        timeout_s = self.parameters.prediction_timeout
        self._watch.set_simulated_time(self._simulated_ns())
        if self._watch.age(timeout_s).age_s > timeout_s:
            self._last = None
            outputs.publish(assessor.expire(prediction), assessor.plan)
            outputs.publish_grid(prediction, assessor.place(prediction), known=False)

    def _current_status(self) -> RiskStatus:
        """Return the node's status, brought up to date."""
        self._watch.set_simulated_time(self._simulated_ns())
        status, timeout_s = self._status, self.parameters.prediction_timeout
        status.state, status.failure = state_of(self), self.failure
        status.namesake = self.namesake("risks")
        status.prediction_timeout_s = timeout_s
        status.input = self._watch.age(timeout_s)
        self._check_publishers()
        return status

    def _check_publishers(self) -> None:
        """Note whether the publishers of both topics are heard, from time to time."""
        now_s = time.monotonic()
        if now_s - self._checked_s < _PUBLISHERS_PERIOD_S:
            return
        self._checked_s = now_s
        status = self._status
        status.publishers = status.plan_publishers = ""
        if self._assessor is None:
            return
        status.publishers = publisher_problem(self, status.topic, _NEWEST)
        status.plan_publishers = publisher_problem(self, status.plan_topic, _ANY)
