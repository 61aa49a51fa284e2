# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``predictor``: which of its parts exist when.

Model and publishers are made at configuration, what listens and predicts at activation; each is
given back at the opposite transition, so that a new configuration starts from nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.diagnostics.counters import Statistics
from mtpgo_ros.diagnostics.diagnostic_status import BAD_MODEL, BAD_TIMING, ODD_INPUT, Facts
from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.throttled_log import Complaints
from mtpgo_ros.node.model_host import Engine
from mtpgo_ros.node.pipeline import Reporting, Service
from mtpgo_ros.node.publishers import Outputs
from mtpgo_ros.parameters.parameter_server import ParameterServer
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_EXPLAINED = ("malformed", "not_lifted", "qos_incompatible", "model_failures", "cycles_failed")
"""Counters whose steps are logged with their reason, where that is known."""

_WORDING = {
    name: wording
    for name, wording in {**ODD_INPUT, **BAD_TIMING, **BAD_MODEL}.items()
    if name not in _EXPLAINED
}

Transition = Callable[["PredictorNode", LifecycleState], TransitionCallbackReturn]


def _told(transition: Transition) -> Transition:
    """A transition whose failure is kept and logged: rclpy itself passes over exceptions."""

    @functools.wraps(transition)
    def told(node: PredictorNode, state: LifecycleState) -> TransitionCallbackReturn:
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

    return told


class PredictorNode(LifecycleNode):
    """Predicts the objects on ``objects`` and publishes under its own name.

    Args:
        node_options: of :class:`rclpy.node.Node`.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.

    Raises:
        ConfigurationError: a parameter was given a value that is not allowed.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__("predictor", **node_options)
        self.failure = ""
        self.starting = False
        self._engine: Engine | None = None
        self._outputs: Outputs | None = None
        self._service: Service | None = None
        self._complain = Complaints(lambda line: self.get_logger().warning(line))
        self._server = ParameterServer(
            self,
            may_reconfigure=lambda: self._engine is None,
            on_change=self._on_parameters,
        )
        self._statistics = Statistics(self._on_count)
        self._facts = Facts()
        self._diagnostics = DiagnosticsPublisher(
            self, self._facts, lambda: self._statistics, self._refresh_facts
        )
        self._diagnostics.set_period(self.parameters.diagnostic_period)
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1)),
            post_callback=lambda _jump: self._on_clock_jump(),
        )

    @property
    def parameters(self) -> PredictorParameters:
        """The parameters that count now."""
        return self._server.value

    @_told
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model and advertise."""
        parameters = self.parameters
        engine = Engine(parameters)
        engine.warm_up()
        self._engine = engine
        self._statistics = Statistics(self._on_count)
        self._facts.degraded = engine.degraded
        if engine.degraded:
            self.get_logger().error(f"degraded, constant velocity serves: {engine.degraded}")
        self._outputs = Outputs(self, parameters.output, parameters.max_modes, self.on_failure)
        return super().on_configure(state)

    @_told
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe and start the worker."""
        assert self._engine is not None
        assert self._outputs is not None
        self._service = Service(
            self,
            self._engine,
            self._outputs,
            self.parameters,
            Reporting(self._statistics, self._facts, self._complain, self.on_failure),
        )
        done = super().on_activate(state)
        about = self._engine.describe()
        self.get_logger().info(
            f"ready: {about['model']} predicts {about['horizon_s']} s ahead at"
            f" {self.parameters.rate:g} Hz, waiting for {self._service.objects.topic}"
        )
        return done

    @_told
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening and predicting."""
        self._stop()
        return super().on_deactivate(state)

    @_told
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give model and publishers back."""
        done = super().on_cleanup(state)
        self._release()
        return done

    @_told
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self._stop()
        done = super().on_shutdown(state)
        self._release()
        return done

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to unconfigured after a transition that raised."""
        self._stop()
        self._release()
        return super().on_error(state)

    def stop(self) -> bool:
        """End all threads before the process ends; false if the model is still running."""
        idle = self._stop()
        self._release()
        return idle

    def on_failure(self, what: str, error: Exception) -> None:
        """Log an exception that the node survived; from any thread."""
        text = " ".join(str(error).split()) or "no message"
        self._complain(what, f"{what}: {type(error).__name__}: {text}")

    def _stop(self) -> bool:
        service, self._service = self._service, None
        return service is None or service.close()

    def _release(self) -> None:
        if self._outputs is not None:
            self._outputs.close()
        self._outputs = None
        self._engine = None

    def _on_parameters(self, parameters: PredictorParameters) -> None:
        self._diagnostics.set_period(parameters.diagnostic_period)
        if self._outputs is not None:
            self._outputs.configure(parameters.output, parameters.max_modes)
        if self._service is not None:
            self._service.configure(parameters)

    def _on_clock_jump(self) -> None:
        if self._service is not None:
            self._service.clock_jumped_back()

    def _on_count(self, name: str, number: int) -> None:
        if name in _WORDING:
            self._complain(name, f"{_WORDING[name]} ({number} more)")

    def _refresh_facts(self) -> None:
        """Bring up to date what the diagnostics tell beside the counters."""
        facts, parameters = self._facts, self.parameters
        facts.period_ms = parameters.period_s * 1e3
        facts.input_timeout_s = parameters.input_timeout
        facts.waiting, facts.notes = "the node is not active", []
        if self._engine is not None:
            facts.values = self._engine.describe()
        if self._engine is not None and self._service is not None:
            objects = self._service.objects
            facts.waiting = objects.status
            facts.topic, facts.message_type = objects.topic, objects.message_type
            facts.notes = self._engine.notes()
            facts.input_age_s = self._service.input_age_s()
