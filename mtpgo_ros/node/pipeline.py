# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An active node's work: from a message to a published prediction.

The subscription's callback reads the message, lifts it into the fixed frame and hands it to the
history; when a prediction is due, the resulting window goes to the worker, which publishes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

from rclpy.clock import ROSClock
from rclpy.lifecycle import LifecycleNode

from msg_adapters.adapter import InputAdapter
from mtpgo_core.errors import FrameError, MtpgoError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.schema import Prediction, Source, TrackedStates
from mtpgo_ros.diagnostics.counters import Statistics
from mtpgo_ros.diagnostics.diagnostic_status import Facts
from mtpgo_ros.diagnostics.throttled_log import Complaints
from mtpgo_ros.node.context_subscriptions import SideInputs
from mtpgo_ros.node.frame_transform import AsItComes, FixedFrameLifter, Lifter
from mtpgo_ros.node.history_input import Intake, Work
from mtpgo_ros.node.inference_worker import Hooks, InferenceWorker, Job
from mtpgo_ros.node.model_host import Engine
from mtpgo_ros.node.objects_subscription import ObjectsInput
from mtpgo_ros.node.publishers import Outputs
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_VEHICLE_FRAMES = ("base_link", "base_footprint", "ego_vehicle", "vehicle", "hero")
"""Usual names of frames that move, for a hint."""


@dataclass(frozen=True)
class Reporting:
    """Where an active node's events go.

    Attributes:
        statistics: counters and latencies.
        facts: what the diagnostics tell beside them.
        complain: throttled log lines.
        failed: told of an exception that was survived.
    """

    statistics: Statistics
    facts: Facts
    complain: Complaints
    failed: Callable[[str, Exception], None]


class Service:
    """Listens and predicts from its making until it is closed.

    Args:
        node: the node, for subscriptions, clock and log.
        engine: the model.
        outputs: the publishers.
        parameters: those that count at first.
        reporting: where events go.

    Attributes:
        objects: the subscription to the objects.
        lifter: into the fixed frame.
        intake: the history's entrance.
        worker: the model's thread.
        ego_topic: what came on the topic ``ego_id``.

    Raises:
        MtpgoError: the input cannot be subscribed to.
    """

    def __init__(
        self,
        node: LifecycleNode,
        engine: Engine,
        outputs: Outputs,
        parameters: PredictorParameters,
        reporting: Reporting,
    ) -> None:
        self._node, self._engine, self._outputs = node, engine, outputs
        self._parameters, self._reporting = parameters, reporting
        self.ego_topic = ""
        self._received_s: float | None = None
        self._received_ros_ns = 0
        engine.pipeline.reset()
        engine.configure(parameters, self.ego_topic)
        reporting.facts.frame_error = ""
        self.intake = Intake(
            TrackHistory(engine.pipeline.task.history),
            engine.pipeline,
            reporting.statistics,
            parameters,
        )
        self.objects = ObjectsInput(
            node, parameters.input_type, self._on_objects, reporting.statistics
        )
        self.lifter: Lifter = AsItComes()
        if parameters.fixed_frame:
            self.lifter = FixedFrameLifter(node, parameters.fixed_frame)
        self._side_inputs = SideInputs(
            node, self._on_ego, engine.take_lanes if engine.wants_lanes else None
        )
        self.worker: InferenceWorker[Work, Prediction] = InferenceWorker(
            Hooks(
                predict=self._predict,
                fallback=engine.fallback,
                publish=self._publish,
                count=reporting.statistics.count,
                failed=reporting.failed,
            )
        )
        self.worker.start()

    def close(self) -> bool:
        """Stop listening and predicting; false if the model is still running all the same."""
        self.objects.close()
        self._side_inputs.close()
        self.lifter.close()
        return self.worker.stop()

    def configure(self, parameters: PredictorParameters) -> None:
        """Take other parameters from the next observation on."""
        self._parameters = parameters
        self.intake.configure(parameters)
        self._engine.configure(parameters, self.ego_topic)

    def clock_jumped_back(self) -> None:
        """The node's clock was set back."""
        self.intake.clock_jumped_back(self._node.get_clock().now().nanoseconds)

    def input_age_s(self) -> float | None:
        """Time since the last message (s), None before the first.

        A simulation that stands still or runs slowly does not make the input stale: what has
        passed on the node's clock counts, where that is less.
        """
        if self._received_s is None:
            return None
        age_s = time.monotonic() - self._received_s
        clock = cast(ROSClock, self._node.get_clock())
        if clock.ros_time_is_active:
            passed_ns = clock.now().nanoseconds - self._received_ros_ns
            age_s = min(age_s, max(0.0, passed_ns * 1e-9))
        return age_s

    def _on_objects(self, message: Any, adapter: InputAdapter, received_ns: int) -> None:
        report, topic = self._reporting, self.objects.topic
        report.statistics.count("messages")
        self._received_s = time.monotonic()
        self._received_ros_ns = self._node.get_clock().now().nanoseconds
        try:
            work = self._take(message, adapter, self._received_ros_ns)
        except FrameError as error:
            report.facts.frame_error = str(error)
            report.statistics.count("not_lifted")
            report.complain("frame", f"message on {topic} left out: {error}")
        except MtpgoError as error:
            report.statistics.count("malformed")
            report.complain("malformed", f"message on {topic} left out: {error}")
        except Exception as error:  # Whatever a message holds, the stream goes on.
            report.statistics.count("malformed")
            report.failed(f"message on {topic} left out", error)
        else:
            if work is not None:
                self.worker.submit(self._job(work, received_ns))

    def _take(self, message: Any, adapter: InputAdapter, now_ns: int) -> Work | None:
        decoded = adapter.decode(
            message, twist_frame=self._parameters.twist_frame, fallback_stamp_ns=now_ns
        )
        statistics, facts = self._reporting.statistics, self._reporting.facts
        statistics.count("skipped_objects", decoded.skipped_total)
        statistics.count("empty_messages", int(len(decoded.states) == 0))
        self._warn_of_moving_frame(decoded.states)
        states = self.lifter.lift(decoded.states)
        facts.frame_error, facts.frame_id = "", states.frame_id
        return self.intake.take(states, now_ns)

    def _warn_of_moving_frame(self, states: TrackedStates) -> None:
        if not self._parameters.fixed_frame and states.frame_id in _VEHICLE_FRAMES:
            self._reporting.complain(
                "moving frame",
                f"objects come in frame {states.frame_id!r}, which usually moves with the vehicle:"
                " set the parameter fixed_frame and publish odometry",
            )

    def _job(self, work: Work, received_ns: int) -> Job[Work]:
        period_ns = round(self._parameters.period_s * 1e9)
        budget_ns = round(self._parameters.budget * period_ns)
        return Job(work, received_ns, budget_ns=budget_ns, deadline_ns=period_ns)

    def _predict(self, work: Work) -> Prediction:
        """Called by the worker."""
        prediction = self._engine.predict(work)
        report = self._engine.report
        self._reporting.statistics.count("non_finite_output", report.unusable)
        self._reporting.statistics.count("agents_over_limit", report.over_limit)
        return prediction

    def _publish(self, job: Job[Work], prediction: Prediction) -> None:
        """Called by the worker and its watchdog."""
        self._outputs.publish(prediction)
        took_ns = time.monotonic_ns() - job.received_ns
        statistics, facts = self._reporting.statistics, self._reporting.facts
        statistics.count("predictions")
        statistics.measured(took_ns * 1e-6)
        statistics.count("deadline_misses", int(took_ns > job.deadline_ns))
        facts.over_budget_in_a_row = facts.over_budget_in_a_row + 1 if job.over_budget else 0
        facts.agents = len(prediction)
        facts.fallback_agents = int((prediction.source != Source.MODEL).sum())
        self._outputs.publish_rest(prediction, took_ns * 1e-6)

    def _on_ego(self, text: str) -> None:
        self.ego_topic = text
        self._engine.configure(self._parameters, text)
        if not self._parameters.ego_id:
            told = f"ego is {text!r}" if text else "no ego is chosen any more"
            self._node.get_logger().info(told)
