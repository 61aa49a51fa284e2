# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``predictor``: a thin wrapper around the pipeline.

The subscription's callback reads a message, hands it to the core and, when a prediction is due,
the resulting window to the worker; the worker publishes. All parts are made at configuration and
given back at clean-up, so a new configuration starts from nothing.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from msg_adapters.adapter import InputAdapter
from mtpgo_core.errors import FrameError, MtpgoError
from mtpgo_core.schema import Prediction, Source, TrackedStates
from mtpgo_ros.complaints import Complaints
from mtpgo_ros.declare import ParameterServer
from mtpgo_ros.diagnostics import BAD_MODEL, BAD_TIMING, ODD_INPUT, Facts
from mtpgo_ros.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.engine import Engine
from mtpgo_ros.intake import Intake, Work
from mtpgo_ros.lifting import AsItComes, FixedFrameLifter, Lifter
from mtpgo_ros.objects_input import ObjectsInput
from mtpgo_ros.outputs import Outputs
from mtpgo_ros.parameters import PredictorParameters
from mtpgo_ros.side_inputs import SideInputs
from mtpgo_ros.statistics import Statistics
from mtpgo_ros.worker import Hooks, InferenceWorker, Job

_EXPLAINED = ("malformed", "not_lifted", "qos_incompatible", "model_failures", "cycles_failed")
"""Counters whose steps are logged with their reason, where that is known."""

_WORDING = {
    name: wording
    for name, wording in {**ODD_INPUT, **BAD_TIMING, **BAD_MODEL}.items()
    if name not in _EXPLAINED
}
_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
_VEHICLE_FRAMES = ("base_link", "base_footprint", "ego_vehicle", "vehicle", "hero")


class PredictorNode(LifecycleNode):
    """Predicts the objects on ``objects`` and publishes under its own name.

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
        self._active = False
        self._engine: Engine | None = None
        self._outputs: Outputs | None = None
        self._complain = Complaints(lambda line: self.get_logger().warning(line))
        self._server = ParameterServer(
            self,
            may_reconfigure=lambda: self._engine is None,
            on_change=self._on_parameters,
        )
        self._statistics = Statistics(self._on_count)
        self._facts = Facts(waiting="the node is not active")
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

    # ------------------------------------------------------------------ life cycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model and advertise."""
        try:
            self._engine = Engine(self.parameters)
            self._engine.warm_up()
        except MtpgoError as error:
            self._engine = None
            return self._failed("not configured", error)
        self.failure = ""
        self._statistics = Statistics(self._on_count)
        self._facts.degraded = self._engine.degraded
        if self._engine.degraded:
            self.get_logger().error(f"degraded, constant velocity serves: {self._engine.degraded}")
        self._outputs = Outputs(
            self, self.parameters.output, self.parameters.max_modes, self.on_failure
        )
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe and start the worker."""
        assert self._engine is not None
        parameters = self.parameters
        self._ego_topic = ""
        self._engine.pipeline.reset()
        self._engine.configure(parameters, self._ego_topic)
        self._intake = Intake(self._engine.pipeline, self._statistics, parameters)
        self._lifter: Lifter = AsItComes()
        if parameters.fixed_frame:
            self._lifter = FixedFrameLifter(self, parameters.fixed_frame)
        try:
            self._input = ObjectsInput(
                self, parameters.input_type, self._on_objects, self._statistics
            )
        except MtpgoError as error:
            self._lifter.close()
            return self._failed("not activated", error)
        self._side_inputs = SideInputs(
            self,
            self._on_ego,
            self._engine.take_lanes if self._engine.wants_lanes else None,
        )
        self._received_s: float | None = None
        self._facts.frame_error = ""
        self._worker = InferenceWorker(
            Hooks(
                predict=self._predict,
                fallback=self._engine.fallback,
                publish=self._publish,
                count=self._statistics.count,
                failed=self.on_failure,
            )
        )
        self._worker.start()
        self._active = True
        done = super().on_activate(state)
        self.get_logger().info(self._ready_line())
        return done

    def _ready_line(self) -> str:
        assert self._engine is not None
        about = self._engine.describe()
        return (
            f"ready: {about['model']} predicts {about['horizon_s']} s ahead at"
            f" {self.parameters.rate:g} Hz, waiting for {self._input.topic}"
        )

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening and predicting."""
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give model and publishers back."""
        done = super().on_cleanup(state)
        self._release()
        return done

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self._stop()
        done = super().on_shutdown(state)
        self._release()
        return done

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to unconfigured after a failed transition."""
        self._stop()
        self._release()
        return super().on_error(state)

    def _failed(self, what: str, error: MtpgoError) -> TransitionCallbackReturn:
        self.failure = str(error)
        if not self.starting:
            self.get_logger().error(f"{what}: {error}")
        return _FAILURE

    def _stop(self) -> bool:
        """Stop listening and predicting; false if the model is still running all the same."""
        if not self._active:
            return True
        self._active = False
        self._input.close()
        self._side_inputs.close()
        self._lifter.close()
        return self._worker.stop()

    def _release(self) -> None:
        if self._outputs is not None:
            self._outputs.close()
        self._outputs = None
        self._engine = None

    def stop(self) -> bool:
        """End all threads before the process ends; false if the model is still running."""
        idle = self._stop()
        self._release()
        return idle

    # ------------------------------------------------------------------ from message to work

    def _on_objects(self, message: Any, adapter: InputAdapter, received_ns: int) -> None:
        self._statistics.count("messages")
        self._received_s = time.monotonic()
        try:
            work = self._take(message, adapter)
        except FrameError as error:
            self._facts.frame_error = str(error)
            self._statistics.count("not_lifted")
            self._complain("frame", f"message on {self._input.topic} left out: {error}")
        except MtpgoError as error:
            self._statistics.count("malformed")
            self._complain("malformed", f"message on {self._input.topic} left out: {error}")
        except Exception as error:
            # Whatever a message holds, the stream goes on.
            self._statistics.count("malformed")
            self.on_failure(f"message on {self._input.topic} left out", error)
        else:
            if work is not None:
                self._worker.submit(self._job(work, received_ns))

    def _take(self, message: Any, adapter: InputAdapter) -> Work | None:
        now_ns = self.get_clock().now().nanoseconds
        decoded = adapter.decode(
            message,
            twist_frame=self.parameters.twist_frame,
            fallback_stamp_ns=now_ns,
        )
        self._statistics.count("skipped_objects", decoded.skipped_total)
        if len(decoded.states) == 0:
            self._statistics.count("empty_messages")
        self._warn_of_moving_frame(decoded.states)
        states = self._lifter.lift(decoded.states)
        self._facts.frame_error = ""
        self._facts.frame_id = states.frame_id
        return self._intake.take(states, now_ns)

    def _warn_of_moving_frame(self, states: TrackedStates) -> None:
        if not self.parameters.fixed_frame and states.frame_id in _VEHICLE_FRAMES:
            self._complain(
                "moving frame",
                f"objects come in frame {states.frame_id!r}, which usually moves with the vehicle:"
                " set the parameter fixed_frame and publish odometry",
            )

    def _job(self, work: Work, received_ns: int) -> Job[Work]:
        period_ns = round(self.parameters.period_s * 1e9)
        return Job(
            work,
            received_ns,
            budget_ns=round(self.parameters.budget * period_ns),
            deadline_ns=period_ns,
        )

    # ------------------------------------------------------------------ from prediction to message

    def _predict(self, work: Work) -> Prediction:
        """Called by the worker."""
        engine = self._engine
        assert engine is not None
        prediction = engine.predict(work)
        self._statistics.count("non_finite_output", engine.report.unusable)
        self._statistics.count("agents_over_limit", engine.report.over_limit)
        return prediction

    def _publish(self, job: Job[Work], prediction: Prediction) -> None:
        """Called by the worker and its watchdog."""
        outputs, engine, facts = self._outputs, self._engine, self._facts
        if outputs is None or engine is None:
            return
        outputs.publish(prediction)
        took_ns = time.monotonic_ns() - job.received_ns
        self._statistics.count("predictions")
        self._statistics.measured(took_ns * 1e-6)
        if took_ns > job.deadline_ns:
            self._statistics.count("deadline_misses")
        facts.over_budget_in_a_row = facts.over_budget_in_a_row + 1 if job.over_budget else 0
        facts.agents = len(prediction)
        facts.fallback_agents = int((prediction.source != Source.MODEL).sum())
        outputs.publish_rest(prediction, took_ns * 1e-6)

    # ------------------------------------------------------------------ events

    def _on_parameters(self, parameters: PredictorParameters) -> None:
        self._diagnostics.set_period(parameters.diagnostic_period)
        if self._outputs is not None:
            self._outputs.configure(parameters.output, parameters.max_modes)
        if self._active and self._engine is not None:
            self._intake.configure(parameters)
            self._engine.configure(parameters, self._ego_topic)

    def _on_ego(self, text: str) -> None:
        self._ego_topic = text
        if self._engine is not None:
            self._engine.configure(self.parameters, text)
        if not self.parameters.ego_id:
            self.get_logger().info(f"ego is {text!r}" if text else "no ego is chosen any more")

    def _on_clock_jump(self) -> None:
        if self._active:
            self._intake.clock_jumped_back(self.get_clock().now().nanoseconds)

    def _on_count(self, name: str, number: int) -> None:
        if name in _WORDING:
            self._complain(name, f"{_WORDING[name]} ({number} more)")

    def on_failure(self, what: str, error: Exception) -> None:
        """Log an exception that the node survived; from any thread."""
        text = " ".join(str(error).split()) or "no message"
        self._complain(what, f"{what}: {type(error).__name__}: {text}")

    def _refresh_facts(self) -> None:
        """Bring up to date what the diagnostics tell beside the counters."""
        facts, parameters = self._facts, self.parameters
        facts.period_ms = parameters.period_s * 1e3
        facts.input_timeout_s = parameters.input_timeout
        facts.waiting, facts.notes = "the node is not active", []
        if self._engine is not None:
            facts.values = self._engine.describe()
        if self._active and self._engine is not None:
            facts.waiting = self._input.status
            facts.topic, facts.message_type = self._input.topic, self._input.message_type
            facts.notes = self._engine.notes()
            received_s = self._received_s
            facts.input_age_s = None if received_s is None else time.monotonic() - received_s
