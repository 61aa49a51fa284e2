# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The data path of an active node: from a message to a published prediction.

The subscription's callback decodes the message, transforms it into the fixed frame and updates the
history; when a prediction is due, it hands a window to the worker, which predicts and publishes.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from typing import Any, cast

from rclpy.clock import ROSClock
from rclpy.lifecycle import LifecycleNode

from msg_adapters.adapter import InputAdapter
from mtpgo_core.class_map import class_map
from mtpgo_core.errors import FrameError, MessageError, MtpgoError
from mtpgo_core.frames import moves_with_vehicle
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.finite_output import publishable
from mtpgo_core.prediction.output_assembly import select, with_time_origin, without_agent
from mtpgo_core.schema import (
    HistoryWindow,
    Prediction,
    Source,
    TrackedStates,
    tracked_states,
)
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus
from mtpgo_ros.diagnostics.event_log import REPEAT_S, EventLog
from mtpgo_ros.diagnostics.input_watch import InputWatch
from mtpgo_ros.node.context_subscriptions import ContextSubscriptions
from mtpgo_ros.node.ego.ego_subscription import ego_source
from mtpgo_ros.node.frame_transform import FixedFrameTransform, FrameTransform, NoTransform
from mtpgo_ros.node.history_input import HistoryInput
from mtpgo_ros.node.inference.inference_worker import InferenceWorker
from mtpgo_ros.node.inference.late_cycle import late_cycle
from mtpgo_ros.node.inference.prediction_request import PredictionRequest
from mtpgo_ros.node.lanes.lane_input import no_pose
from mtpgo_ros.node.lanes.lane_transform import LaneTransform
from mtpgo_ros.node.load_control import LoadControl, overload
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.node.objects_subscription import ObjectsSubscription
from mtpgo_ros.node.publishers import Publishers
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.quality.live_quality import LiveQuality
from mtpgo_ros.quality.quality_publisher import QualityPublisher
from mtpgo_ros.runtime.clock_watch import ClockSteps, set_sentence
from mtpgo_ros.runtime.receipt_clock import Receipt

_LONGEST_WAIT_S = 1.0
"""The end of a cycle is waited for at most this long (s); chosen."""

_SETTLES_S = 0.3
"""What was stamped before the machine's clock was set comes within this time (s); chosen: more
than trackers take from the measurement to the message."""

_LONGEST_SCORING_S = 0.05
"""A prediction waits at most this long for the scores of earlier ones (s); chosen: a quarter of a
period of 5 Hz. They take a few milliseconds with 64 road users, less than the model."""


class PredictionPipeline:
    """Subscribes and predicts from its construction until it is closed.

    Args:
        node: the node, for subscriptions, clock and log.
        model: the model.
        publishers: the outputs.
        parameters: the initial parameters.
        events: where everything unusual is counted and logged.
        status: the state that the diagnostics report, updated here.

    Attributes:
        objects: the subscription to the objects.
        watch: the age of the input.
        transform: into the fixed frame.
        history: the history and its rate limit.
        quality: scores of the predictions.
        worker: the threads of the model and its watchdog.
        ego: adds the ego by its odometry.
        ego_text: last text on the topic ``ego_id``.

    Raises:
        MtpgoError: the input cannot be subscribed to.
    """

    def __init__(
        self,
        node: LifecycleNode,
        model: ModelHost,
        publishers: Publishers,
        parameters: PredictorParameters,
        events: EventLog,
        status: NodeStatus,
    ) -> None:
        self._node, self._model, self._publishers = node, model, publishers
        self._parameters, self._events, self._status = parameters, events, status
        self._class_map = class_map(parameters.class_map)
        self.ego_text, self._ego_chosen_s = "", float("-inf")
        # Observations come on the thread of their subscription, all else on the executor's.
        self._history_lock = threading.Lock()
        self.watch = InputWatch()
        self._published_s: float | None = None
        self._said_first = False
        self._clock_steps, self._settled_s = ClockSteps(), 0.0
        self._unanswered_since_s: float | None = None
        self._cycle_ended = threading.Event()
        model.reset()
        model.calibrator.live.clear_stream("clock_reset")
        model.configure(parameters, self.ego_text)
        status.frame_error = status.ego_problem = status.overload = ""
        status.doubts, status.frame_problems = [], []
        status.agents = status.fallback_agents = status.preferred_agents = 0
        status.without_model_in_a_row = status.over_budget_in_a_row = 0
        self._tracks = TrackHistory(
            model.predictor.task.history, parameters.max_tracks, first_number=model.next_track
        )
        self.history = HistoryInput(self._tracks, model, events, parameters)
        self.quality = LiveQuality(model.predictor.task.history)
        self._load = LoadControl()
        self.transform: FrameTransform = NoTransform()
        if parameters.fixed_frame:
            self.transform = FixedFrameTransform(node, parameters.fixed_frame, events)
        self.ego = ego_source(node, parameters, events)
        self._context = ContextSubscriptions(node, self._on_ego, None, events)
        self._lane_transform = LaneTransform(node)
        self._quality_publisher = QualityPublisher(node, self.quality, parameters, status)
        with contextlib.ExitStack() as threads:  # which what fails after them has to end
            threads.callback(self._context.close)
            self._use_lanes()
            self.objects = ObjectsSubscription(
                node, parameters.input_type, self._on_objects, events, parameters.input_limits
            )
            threads.pop_all()
        self.worker = InferenceWorker(self._predict, model.fallback, self._publish, events)
        self.worker.start()

    def close(self) -> bool:
        """Stop subscribing and predicting; return false if the model is still running."""
        self.objects.close()
        self._context.close()
        self.ego.close()
        self._lane_transform.close()
        self.transform.close()
        self._quality_publisher.close()
        stopped = self.worker.stop()
        self._model.next_track = self._tracks.next_number
        self._model.calibrator.close()
        return stopped

    def configure(self, parameters: PredictorParameters) -> None:
        """Use other parameters from the next observation on."""
        self._parameters = parameters
        self.objects.limits = parameters.input_limits
        with self._history_lock:
            self.history.configure(parameters)
        self._quality_publisher.configure(parameters)
        from_topic = not self._model.uses_lanes or self._model.lanes.from_topic
        self._model.configure(parameters, self.ego_text)
        if self._model.uses_lanes and from_topic != self._model.lanes.from_topic:
            self._use_lanes()

    def clock_jumped_back(self) -> None:
        """Clear a history that is newer than the node's clock."""
        with self._history_lock:
            if self.history.clock_jumped_back(self._node.get_clock().now().nanoseconds):
                self._forget_stream()

    def _notice_clock(self) -> None:
        """Start anew when the machine's clock was set: stamps from before are of another time.

        Some of those may still come. Until then no observation is put beside an earlier one.
        """
        clock, now_s = cast(ROSClock, self._node.get_clock()), time.monotonic()
        change_ns = self._clock_steps.change_ns()
        was_set = change_ns != 0 and not clock.ros_time_is_active
        if was_set:
            sentence = f"{set_sentence(change_ns * 1e-9)}: the history is cleared"
            self._events.count("clock_set", reason=sentence)
        elif not self._settled_s:
            return
        with self._history_lock:
            if not was_set and now_s < self._settled_s:
                self.history.forget_tracks()
                return
            self.history.reset()
            self._forget_stream()
        self._settled_s = now_s + _SETTLES_S if was_set else 0.0

    def _forget_stream(self) -> None:
        """Forget all that depends on the history, which was cleared."""
        self.ego.clear()
        self._forget_poses()
        self.quality.clear()
        self._model.calibrator.live.clear_stream("clock_reset")

    def _forget_poses(self) -> None:
        """Forget where frames were: poses of another time would be mixed with the new ones."""
        self.transform.clear()
        self._lane_transform.clear()

    def unanswered_s(self) -> float:
        """Return how long an observation that is due has waited for any prediction (s)."""
        since_s = self._unanswered_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def idle_s(self) -> float:
        """Return the time since the last prediction, infinite before the first (s)."""
        published_s = self._published_s
        return float("inf") if published_s is None else time.monotonic() - published_s

    @contextlib.contextmanager
    def no_cycle_skipped(self) -> Iterator[None]:
        """Let no cycle be skipped within the block, which begins right after a cycle; any thread.

        For work that blocks all other threads: the observations that arrive meanwhile are handled
        immediately afterwards, and each of them is answered.
        """
        self._cycle_ended.clear()
        self._cycle_ended.wait(min(_LONGEST_WAIT_S, 2.0 * self._parameters.period_s))
        self.worker.skips = False
        try:
            yield
        finally:
            self.worker.skips = True

    def model_changed(self) -> None:
        """Use another model's inputs after a swap, which keeps the history, and score it anew."""
        self.quality.start_anew()
        self._use_lanes()

    def _use_lanes(self) -> None:
        """Give the model lane lines if it uses them: of a file, else those that are published."""
        model, lanes = self._model, self._model.lanes
        topic = model.uses_lanes and lanes.from_topic
        self._context.use_lanes(lanes.take_markings if topic else None, lanes.refuse_markings)
        lanes.on_read = self._on_lane_file
        lanes.pose_in = no_pose
        if model.uses_lanes:
            lanes.pose_in = self._lane_transform.pose_in()

    def _on_lane_file(self, sentence: str, is_error: bool) -> None:
        if is_error:
            self._events.log("lanes", sentence, is_error=True)
        else:
            self._node.get_logger().info(sentence)

    def _on_objects(self, message: Any, adapter: InputAdapter, receipt: Receipt) -> None:
        """Handle a message; called by the subscription's thread."""
        dropped = f"message on {self.objects.topic} left out"
        self._notice_clock()
        now_ns = self._node.get_clock().now().nanoseconds
        came_ns = self._came_ns(now_ns, receipt)
        try:
            states, skipped = self._read(message, adapter, came_ns)
            ego_key = self._model.ego_key
            joined = self.ego.join(states, ego_key, self.transform.apply)
            states, self._status.ego_problem = joined.states, joined.problem
            with self._history_lock:
                window = self.history.update(
                    states,
                    now_ns,
                    ego_key,
                    skipped,
                    with_ego=joined.added,
                    doubles=joined.double_keys,
                    receipt=receipt,
                )
            self._status.doubts = list(self.history.checks.doubts.values())
            if self.history.report is not None and self.history.report.clock_reset:
                self._forget_poses()
            if self._model.uses_lanes and window is not None:
                self._model.lanes.observe(_present(window))
        except FrameError as error:
            self._status.frame_error = str(error)
            self._events.count("not_lifted", reason=f"{dropped}: {error}")
            self.watch.reject(ODD_INPUT["not_lifted"])
        except MtpgoError as error:
            self._events.count("malformed", reason=f"{dropped}: {error}", detail=str(error))
            self.watch.reject(ODD_INPUT["malformed"])
        except Exception as error:  # Whatever a message contains, the node keeps running.
            self._events.failure(dropped, error, "malformed")
            self.watch.reject(ODD_INPUT["malformed"])
        else:
            if self.history.rejection:
                self.watch.reject(self.history.rejection)
            else:
                self.watch.accept()
            if window is None:
                self._score()
            else:
                self._submit(self._request(window, states.stamp_ns, receipt.monotonic_ns))
        finally:
            self._events.count("messages")

    def _submit(self, request: PredictionRequest) -> None:
        """Submit a request to the worker, and score earlier predictions meanwhile."""
        if self._unanswered_since_s is None:
            self._unanswered_since_s = time.monotonic()
        self.worker.submit(request)
        self._score()
        request.scored.set()

    def _score(self) -> None:
        """Score earlier predictions by the last observation, while the model is at work."""
        if self.history.report is None:
            return
        try:
            with self._history_lock:
                self.quality.observed(self._tracks, self.history.report)
                self._model.calibrator.observe(self._tracks, self.history.report)
        except Exception as error:
            self._events.failure("earlier predictions could not be scored", error)

    def _came_ns(self, now_ns: int, receipt: Receipt) -> int:
        """Return when a message was received, by the node's clock (ns).

        It may have waited since; a simulated clock does not say for how long.
        """
        if cast(ROSClock, self._node.get_clock()).ros_time_is_active or not receipt.monotonic_ns:
            return now_ns
        return now_ns - max(0, time.monotonic_ns() - receipt.monotonic_ns)

    def _read(
        self, message: Any, adapter: InputAdapter, came_ns: int
    ) -> tuple[TrackedStates, int]:
        """Return the states in the fixed frame, and how many objects could not be read."""
        if isinstance(message, MessageError):
            raise message
        decoded = adapter.decode(
            message,
            twist_frame=self._parameters.twist_frame,
            fallback_stamp_ns=came_ns,
            limits=self.objects.limits,
            class_map=self._class_map,
        )
        self._events.count(
            "skipped_objects", decoded.skipped_total, detail=", ".join(decoded.skipped)
        )
        objects = len(decoded.states) + decoded.skipped_total
        self._events.count("empty_messages", int(objects == 0))
        self._warn_of_frame(decoded.states)
        states = self.transform.apply(decoded.states)
        self._status.frame_error, self._status.frame_id = "", states.frame_id
        return states, decoded.skipped_total

    def _warn_of_frame(self, states: TrackedStates) -> None:
        """Report a frame that can be read but is not a usual fixed one."""
        problems = {}
        if len(states) and (not states.frame_id or states.frame_id.startswith("/")):
            problems["frame name"] = (
                f"objects come in frame {states.frame_id!r}, which neither TF nor displays accept:"
                " expected a name without a leading slash in their header"
            )
        if not self._parameters.fixed_frame and moves_with_vehicle(states.frame_id):
            problems["moving frame"] = (
                f"objects come in frame {states.frame_id!r}, which usually moves with the vehicle:"
                " set the parameter fixed_frame and publish odometry"
            )
        for kind, sentence in problems.items():
            self._events.log(kind, sentence)
        self._status.frame_problems = list(problems.values())

    def _request(
        self, window: HistoryWindow, stamp_ns: int, received_ns: int
    ) -> PredictionRequest:
        period_ns = round(self._parameters.period_s * 1e9)
        budget_ns = self._load.budget_ns(self._parameters.budget, period_ns)
        return PredictionRequest(window, stamp_ns, received_ns, budget_ns, deadline_ns=period_ns)

    def _predict(self, window: HistoryWindow) -> Prediction:
        """Return the prediction of a window; called by the worker."""
        predictor = self._model.predictor
        predictor.allowed_s = self._load.allowed_s(
            self._parameters.budget, self._parameters.period_s
        )
        prediction = self._model.predict(window)
        report = predictor.last_report
        self._status.overload = overload(report, predictor.modes)
        self._events.count("non_finite_output", report.unusable)
        self._events.count("agents_over_limit", report.over_limit)
        return prediction

    def _publish(self, request: PredictionRequest, prediction: Prediction) -> None:
        """Publish a prediction; called by the worker and its watchdog."""
        request.scored.wait(_LONGEST_SCORING_S)
        begun_ns = time.monotonic_ns()
        prediction = with_time_origin(prediction, request.stamp_ns)
        if not self._parameters.ego_predicted:  # nor is anything learned from it
            prediction = without_agent(prediction, self._model.ego_key)
        prediction = self._model.calibrator.serve(prediction, request.window)
        usable = publishable(prediction)
        if not usable.all():
            self._events.count("not_published", int((~usable).sum()))
            prediction = select(prediction, usable)
        self._publishers.publish(prediction)
        published_ns = time.monotonic_ns()
        self._load.published(published_ns - begun_ns)
        latency_ns = published_ns - request.received_ns
        self._published_s, self._unanswered_since_s = time.monotonic(), None
        self._events.count("predictions")
        if latency_ns > request.deadline_ns:
            self._events.count("deadline_misses", reason=late_cycle(request, published_ns))
        self._status.latency.add(latency_ns * 1e-6)
        self._note_sources(request, prediction)
        self._publishers.publish_secondary(prediction, latency_ns * 1e-6)
        if len(prediction) and not self._said_first:
            self._said_first = True
            self._node.get_logger().info(
                f"first prediction: {len(prediction)} road user(s), {latency_ns * 1e-6:.0f} ms"
                " after their observation"
            )
        self.quality.published(prediction, request.window, self._parameters.max_modes)
        self._cycle_ended.set()

    def _note_sources(self, request: PredictionRequest, prediction: Prediction) -> None:
        """Note in the status how many agents the model served, and for how long it has not."""
        status = self._status
        status.over_budget_in_a_row = status.over_budget_in_a_row + 1 if request.over_budget else 0
        status.agents = len(prediction)
        constant = prediction.source == Source.CONSTANT_VELOCITY
        preferred = prediction.source == Source.PREFERRED_CONSTANT_VELOCITY
        status.fallback_agents = int(constant.sum())
        status.preferred_agents = int(preferred.sum())
        if not request.over_budget:
            unserved = 0 < status.agents == status.fallback_agents
            status.without_model_in_a_row = status.without_model_in_a_row + 1 if unserved else 0

    def _on_ego(self, text: str) -> None:
        changed, self.ego_text = text != self.ego_text, text
        self._model.configure(self._parameters, text)
        if not changed or self._parameters.ego_id:
            return
        line = f"ego is {text!r:.80}" if text else "no ego is chosen any more"
        before_s, self._ego_chosen_s = self._ego_chosen_s, time.monotonic()
        if self._ego_chosen_s - before_s > REPEAT_S:
            self._node.get_logger().info(line)
        else:
            also = f", the choice before is {self._ego_chosen_s - before_s:.2g} s old"
            self._events.log("ego_id", line + also)


def _present(window: HistoryWindow) -> TrackedStates:
    """Return where the road users are at a window's time, and how they move."""
    here = window.select(window.valid[:, -1])
    return tracked_states(
        window.stamp_ns,
        window.frame_id,
        here.key,
        here.position[:, -1],
        agent_class=here.agent_class,
        velocity=here.velocity[:, -1],
    )
