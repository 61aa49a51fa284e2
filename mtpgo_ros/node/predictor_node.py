# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``predictor``: which of its parts exist in which state.

Model and publishers are created at configuration, the pipeline at activation; each is destroyed at
the opposite transition, so that a new configuration starts from nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus, diagnostic_statuses
from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.event_log import RECENT_S
from mtpgo_ros.diagnostics.input_watch import InputAge
from mtpgo_ros.diagnostics.latency import LatencyStatistics
from mtpgo_ros.lifecycle.lifecycle_answers import state_of
from mtpgo_ros.lifecycle.new_entities import nothing_left_behind
from mtpgo_ros.lifecycle.own_topics import refuse_own_topics
from mtpgo_ros.lifecycle.recorded_transition import record_failure
from mtpgo_ros.lifecycle.resource_node import ResourceNode
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.node.model_swap import ModelSwap
from mtpgo_ros.node.objects_subscription import TOPIC as OBJECTS_TOPIC
from mtpgo_ros.node.prediction_pipeline import PredictionPipeline
from mtpgo_ros.node.publishers import OUTPUT_TOPICS, Publishers
from mtpgo_ros.parameters.parameter_server import ParameterServer
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters, updated
from mtpgo_ros.quality.quality_publisher import QUALITY_TOPICS
from mtpgo_ros.runtime.allocator import keep_heap_resident
from mtpgo_ros.runtime.executable import interruptible

_ODOMETRY = "nav_msgs/msg/Odometry"

_HEAP_CHECK_S = 1.0
"""Time within which a heap that has grown is in memory (s); chosen."""

_HEARD = {
    OBJECTS_TOPIC: "objects of any type",
    "odometry": _ODOMETRY,
    "ego_id": "std_msgs/msg/String",
    "lane_markings": "visualization_msgs/msg/MarkerArray",
}
"""Topics that the node subscribes to, some of them later or not at all, and their types."""


class PredictorNode(ResourceNode):
    """Predicts the objects on ``objects`` and publishes the predictions under its own name.

    Args:
        arguments: of the process, for warnings about parameters.
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
        events: where everything unusual is counted and logged.

    Raises:
        ConfigurationError: a parameter has a value that is not allowed.
    """

    def __init__(self, *, arguments: Sequence[str] = (), **node_options: Any) -> None:
        super().__init__("predictor", **node_options)
        self._model: ModelHost | None = None
        self._outputs: Publishers | None = None
        self._pipeline: PredictionPipeline | None = None
        self._server = ParameterServer(
            self,
            PredictorParameters(),
            updated,
            may_reconfigure=lambda: self._model is None,
            on_change=self._on_parameters,
            arguments=arguments,
        )
        self._status = NodeStatus()
        self._diagnostics = DiagnosticsPublisher(
            self, self.events, self._current_status, diagnostic_statuses
        )
        self._diagnostics.set_period(self.parameters.diagnostic_period)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._heap_timer = self.create_timer(_HEAP_CHECK_S, self._keep_heap, clock=steady)
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1)),
            post_callback=lambda _jump: self._on_clock_jump(),
        )
        self._swap = ModelSwap(
            self,
            self._server,
            current=lambda: self._model,
            no_cycle_skipped=self._no_cycle_skipped,
            on_swapped=self._on_swapped,
        )

    @property
    def parameters(self) -> PredictorParameters:
        """The current parameters."""
        return self._server.value

    @record_failure
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model and create the publishers."""
        parameters = self.parameters
        with self.long_step(), interruptible():
            model = ModelHost(parameters)
            model.warm_up()
        self._model = model
        self.events.reset()
        self._status.latency = LatencyStatistics()
        self._status.degraded = model.degraded
        if model.calibrator.file_error:
            self.get_logger().warning(model.calibrator.file_error)
        if model.lanes_read:
            self.get_logger().info(f"lane file: {model.lanes_read}")
        elif self.parameters.lane_file:
            self.get_logger().warning(
                f"lane_file {self.parameters.lane_file} is not read: model"
                f" {model.predictor.task.name} does not use lanes"
            )
        if model.degraded:
            self.get_logger().error(f"degraded, constant velocity serves: {model.degraded}")
        with nothing_left_behind(self):
            self._outputs = Publishers(self, parameters.output, parameters.max_modes, self.events)
        return super().on_configure(state)

    @record_failure
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe and start the worker."""
        assert self._model is not None
        assert self._outputs is not None
        ego_topic = self.parameters.ego_topic
        heard = {ego_topic: _ODOMETRY, **_HEARD} if ego_topic else _HEARD
        refuse_own_topics(self, heard, (*OUTPUT_TOPICS.values(), *QUALITY_TOPICS))
        with nothing_left_behind(self):
            self._pipeline = PredictionPipeline(
                self, self._model, self._outputs, self.parameters, self.events, self._status
            )
        done = self._activated(state)
        about = self._model.describe()
        self.get_logger().info(
            f"ready: {about['model']} predicts {about['horizon_s']} s ahead at"
            f" {self.parameters.rate:g} Hz, waiting for {self._pipeline.objects.topic}"
        )
        return done

    def stop(self) -> bool:
        """End all threads before the process ends; return false if the model is still running."""
        return super().stop() and not self._swap.busy

    def _close(self) -> bool:
        pipeline, self._pipeline = self._pipeline, None
        return pipeline is None or pipeline.close()

    def _release(self) -> None:
        if self._outputs is not None:
            self._outputs.close()
        self._outputs = None
        self._model = None

    def _on_parameters(self, parameters: PredictorParameters) -> None:
        self._diagnostics.set_period(parameters.diagnostic_period)
        if self._outputs is not None:
            self._outputs.configure(parameters.output, parameters.max_modes)
        if self._pipeline is not None:
            self._pipeline.configure(parameters)

    def _on_clock_jump(self) -> None:
        if self._pipeline is not None:
            self._pipeline.clock_jumped_back()

    def _no_cycle_skipped(self) -> AbstractContextManager[None]:
        return nullcontext() if self._pipeline is None else self._pipeline.no_cycle_skipped()

    def _on_swapped(self) -> None:
        if self._model is not None:
            self._status.degraded = self._model.degraded
        if self._pipeline is not None:
            self._pipeline.model_changed()

    def _keep_heap(self) -> None:
        # Not before: an inactive node would keep what loading its model has freed.
        if self._pipeline is not None:
            keep_heap_resident()

    def _current_status(self) -> NodeStatus:
        """Return the node's status, brought up to date."""
        status, parameters = self._status, self.parameters
        status.state, status.failure = state_of(self), self.failure
        status.period_ms = parameters.period_s * 1e3
        status.input_timeout_s = parameters.input_timeout
        status.namesake = self.namesake("predictions")
        status.model = {} if self._model is None else self._model.describe()
        if self._model is None:
            status.degraded = ""
        status.calibration, status.calibration_problem, status.preferred = {}, "", []
        if self._model is not None:
            calibrator = self._model.calibrator
            status.calibration = calibrator.values()
            status.calibration_problem = calibrator.file_error
            status.preferred = calibrator.preferred
        status.limitations, status.waiting = [], ""
        status.idle, status.unanswered_s, status.input = True, 0.0, InputAge()
        status.left_out, status.nothing_published = [], False
        if self._outputs is not None:
            status.left_out = list(self._outputs.left_out.values())
            status.nothing_published = self._outputs.nothing
        pipeline = self._pipeline
        if self._model is not None and pipeline is not None:
            status.limitations = self._model.limitations()
            status.waiting = pipeline.objects.status
            status.topic = pipeline.objects.topic
            status.ego_topic = pipeline.ego.topic
            status.message_type = pipeline.objects.message_type
            status.idle = pipeline.idle_s() > max(RECENT_S, 3.0 * parameters.period_s)
            status.unanswered_s = pipeline.unanswered_s()
            pipeline.watch.set_simulated_time(self._simulated_ns())
            status.input = pipeline.watch.age(parameters.input_timeout)
        return status
