# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``predictor``: which of its parts exist in which state.

Model and publishers are created at configuration, the pipeline at activation; each is destroyed at
the opposite transition, so that a new configuration starts from nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus
from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.latency import LatencyStatistics
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.node.prediction_pipeline import PredictionPipeline
from mtpgo_ros.node.publishers import Publishers
from mtpgo_ros.parameters.parameter_server import ParameterServer
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

Transition = Callable[["PredictorNode", LifecycleState], TransitionCallbackReturn]


def _record_failure(transition: Transition) -> Transition:
    """Return a transition whose failure is stored and logged: rclpy itself ignores exceptions."""

    @functools.wraps(transition)
    def recorded(node: PredictorNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            node.failure = ""
            return transition(node, state)
        except MtpgoError as error:
            node.failure = str(error)
            result = TransitionCallbackReturn.FAILURE
        except Exception as error:
            node.failure = f"{transition.__name__}: {type(error).__name__}: {error}"
            result = TransitionCallbackReturn.ERROR
        if not node.starting:
            node.get_logger().error(f"transition refused: {node.failure}")
        return result

    return recorded


class PredictorNode(LifecycleNode):
    """Predicts the objects on ``objects`` and publishes the predictions under its own name.

    Args:
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
        events: where everything unusual is counted and logged.

    Raises:
        ConfigurationError: a parameter has a value that is not allowed.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__("predictor", **node_options)
        self.failure = ""
        self.starting = False
        self._model: ModelHost | None = None
        self._outputs: Publishers | None = None
        self._pipeline: PredictionPipeline | None = None
        self.events = EventLog(self.get_logger())
        self._server = ParameterServer(
            self,
            may_reconfigure=lambda: self._model is None,
            on_change=self._on_parameters,
        )
        self._status = NodeStatus()
        self._diagnostics = DiagnosticsPublisher(self, self.events, self._current_status)
        self._diagnostics.set_period(self.parameters.diagnostic_period)
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1)),
            post_callback=lambda _jump: self._on_clock_jump(),
        )

    @property
    def parameters(self) -> PredictorParameters:
        """The current parameters."""
        return self._server.value

    @_record_failure
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model and create the publishers."""
        parameters = self.parameters
        model = ModelHost(parameters)
        model.warm_up()
        self._model = model
        self.events.reset()
        self._status.latency = LatencyStatistics()
        self._status.degraded = model.degraded
        if model.calibrator.file_error:
            self.get_logger().warning(model.calibrator.file_error)
        if model.degraded:
            self.get_logger().error(f"degraded, constant velocity serves: {model.degraded}")
        self._outputs = Publishers(self, parameters.output, parameters.max_modes, self.events)
        return super().on_configure(state)

    @_record_failure
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe and start the worker."""
        assert self._model is not None
        assert self._outputs is not None
        self._pipeline = PredictionPipeline(
            self, self._model, self._outputs, self.parameters, self.events, self._status
        )
        done = super().on_activate(state)
        about = self._model.describe()
        self.get_logger().info(
            f"ready: {about['model']} predicts {about['horizon_s']} s ahead at"
            f" {self.parameters.rate:g} Hz, waiting for {self._pipeline.objects.topic}"
        )
        return done

    @_record_failure
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop subscribing and predicting."""
        self._close_pipeline()
        return super().on_deactivate(state)

    @_record_failure
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release model and publishers."""
        done = super().on_cleanup(state)
        self._release()
        return done

    @_record_failure
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop finally."""
        self._close_pipeline()
        done = super().on_shutdown(state)
        self._release()
        return done

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to unconfigured after a transition that raised."""
        self._close_pipeline()
        self._release()
        return super().on_error(state)

    def stop(self) -> bool:
        """End all threads before the process ends; return false if the model is still running."""
        idle = self._close_pipeline()
        self._release()
        return idle

    def _close_pipeline(self) -> bool:
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

    def _current_status(self) -> NodeStatus:
        """Return the node's status, brought up to date."""
        status, parameters = self._status, self.parameters
        status.period_ms = parameters.period_s * 1e3
        status.input_timeout_s = parameters.input_timeout
        status.waiting, status.limitations = "the node is not active", []
        status.calibration, status.calibration_problem, status.preferred = {}, "", []
        if self._model is not None:
            status.model = self._model.describe()
            calibrator = self._model.calibrator
            status.calibration = calibrator.values()
            status.calibration_problem = calibrator.file_error
            status.preferred = calibrator.preferred
        if self._model is not None and self._pipeline is not None:
            objects = self._pipeline.objects
            status.waiting = objects.status
            status.topic, status.message_type = objects.topic, objects.message_type
            status.limitations = self._model.limitations()
            status.input_age_s = self._pipeline.input_age_s()
        return status
