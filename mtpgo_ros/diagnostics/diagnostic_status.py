# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The diagnostics of the node: statuses for input, model, timing, quality and calibration.

Each status has a list of causes. Every cause begins and ends by itself, hides no other, and has
its own level; the status has the highest, and a sentence for each cause, the worst first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.quality.quality_report import QualityVerdict
from mtpgo_ros.diagnostics.event_log import BAD_MODEL, BAD_TIMING, EventLog, shortened
from mtpgo_ros.diagnostics.input_watch import InputAge
from mtpgo_ros.diagnostics.latency import LatencyStatistics

NEVER_KEEPS_UP = 3
"""Consecutive cycles over budget after which the model counts as too slow for this machine;
chosen: a single busy moment of the machine is shorter."""

UNANSWERED_S = 1.0
"""An observation that is due and has had no prediction for this long, or for three periods if they
are longer, counts as unanswered (s); chosen."""

ACTIVE = "active"

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


Cause = tuple[bytes, str]
"""A level and the sentence that says why."""


class HasState(Protocol):
    """What a node reports about itself: at least its life cycle.

    Attributes:
        state: of the life cycle, as in lifecycle_msgs/State.
        failure: why the last transition failed, empty if it did not.
    """

    state: str
    failure: str


@dataclass
class NodeStatus:
    """The state of the node that is reported besides the counters; the node keeps it up to date.

    Attributes:
        state: of the life cycle, as in lifecycle_msgs/State.
        failure: why the last transition failed, empty if it did not.
        namesake: what is known about another node of the same name, empty without one.
        topic: resolved name of the objects' topic.
        message_type: type subscribed to.
        waiting: what is wrong with the topic's publishers, empty if nothing is.
        frame_id: frame of the last observation.
        input: age of the input.
        input_timeout_s: age from which on the input is stale (s).
        frame_error: why the last observation could not be transformed into the fixed frame, empty
            if it was.
        frame_problems: what is wrong with the frame of the last observation, which is used all the
            same.
        ego_topic: resolved name of the topic with the ego's odometry, empty without one.
        ego_problem: why the ego was not known at the last observation, empty if it was.
        doubts: what does not look right in the input as a whole: units, frames, identities.
        degraded: why there is no model, empty if there is one.
        limitations: other reasons why the predictions are worse than they could be.
        left_out: why some of the selected outputs are not published.
        nothing_published: none of them is.
        overload: what the last prediction lacks because there are many agents, empty if nothing.
        agents: agents of the last prediction.
        fallback_agents: those of them predicted at constant velocity for want of the model.
        preferred_agents: those of them predicted at constant velocity because it has been better.
        without_model_in_a_row: consecutive predictions in time in which the model served no agent.
        over_budget_in_a_row: consecutive cycles over budget.
        idle: no prediction is being made at present, so that those three describe the past.
        unanswered_s: how long an observation that is due has waited for any prediction (s).
        period_ms: shortest time between two predictions (ms).
        latency: of the predictions.
        model: further values for the status of the model.
        quality: verdict on the scores of the predictions, None while there are no scores.
        quality_values: values for the status of the quality.
        calibration_problem: why the calibration file was not used or not written, empty if it was.
        preferred: groups that constant velocity serves because it has been better.
        calibration: values for the status of the calibration.
    """

    state: str = ACTIVE
    failure: str = ""
    namesake: str = ""
    topic: str = ""
    message_type: str = ""
    waiting: str = ""
    frame_id: str = ""
    input: InputAge = field(default_factory=InputAge)
    input_timeout_s: float = 1.0
    frame_error: str = ""
    frame_problems: list[str] = field(default_factory=list)
    ego_topic: str = ""
    ego_problem: str = ""
    doubts: list[str] = field(default_factory=list)
    degraded: str = ""
    limitations: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    nothing_published: bool = False
    overload: str = ""
    agents: int = 0
    fallback_agents: int = 0
    preferred_agents: int = 0
    without_model_in_a_row: int = 0
    over_budget_in_a_row: int = 0
    idle: bool = False
    unanswered_s: float = 0.0
    period_ms: float = 200.0
    latency: LatencyStatistics = field(default_factory=LatencyStatistics)
    model: dict[str, str] = field(default_factory=dict)
    quality: QualityVerdict | None = None
    quality_values: dict[str, str] = field(default_factory=dict)
    calibration_problem: str = ""
    preferred: list[str] = field(default_factory=list)
    calibration: dict[str, str] = field(default_factory=dict)


def diagnostic_statuses(name: str, status: NodeStatus, events: EventLog) -> list[DiagnosticStatus]:
    """Return the five diagnostic statuses of the node ``name``."""
    return [
        _input(name, status, events),
        _model(name, status, events),
        _timing(name, status, events),
        _quality(name, status),
        _calibration(name, status),
    ]


def not_active(status: HasState, consequence: str = "nothing is predicted") -> list[Cause]:
    """Return the one cause of a node that is not active, none for an active one.

    Args:
        status: of the node.
        consequence: what it does not do, for the sentence.
    """
    if status.state == ACTIVE:
        return []
    failed = f"; the last transition failed: {status.failure}" if status.failure else ""
    level = ERROR if failed or status.state == "finalized" else WARN
    again = ", the process has to be started again" if status.state == "finalized" else ""
    sentence = f"the node is not active ({status.state}): {consequence}{again}{failed}"
    return [(level, sentence)]


def worst_first(causes: list[Cause], otherwise: str) -> Cause:
    """Return the highest level of the causes, and their sentences with the worst first.

    Args:
        causes: of one status.
        otherwise: what to say if there is none.
    """
    if not causes:
        return OK, otherwise
    ordered = sorted(causes, key=lambda cause: cause[0], reverse=True)
    return ordered[0][0], "; ".join(dict.fromkeys(sentence for _, sentence in ordered))


def _input(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    age = status.input
    level, message = worst_first(
        not_active(status) or _input_causes(status, events),
        "receiving",
    )
    values = {
        "topic": status.topic,
        "type": status.message_type,
        "frame": status.frame_id,
        "state": status.state,
        "age_s": f"{age.age_s:.3f}" if age.usable else "",
        "rejected_in_a_row": str(age.rejected),
        "clock_stands_s": f"{age.clock_stands_s:.1f}",
        "ego_topic": status.ego_topic,
    }
    counters = ["messages", "empty_messages", "unknown_class", "ego_doubles", *ODD_INPUT]
    values |= counted(events.counts(), counters)
    return make_status(f"{name}: input", level, message, values)


def _input_causes(status: NodeStatus, events: EventLog) -> list[Cause]:
    causes = [(WARN, text) for text in (status.namesake, status.waiting) if text]
    causes += _silence(status) + standing_clock(status.input, status.input_timeout_s)
    if status.frame_error:
        causes.append((ERROR, status.frame_error))
    if status.ego_problem:
        causes.append((WARN, f"no ego from {status.ego_topic}: {status.ego_problem}"))
    causes += [(WARN, sentence) for sentence in (*status.frame_problems, *status.doubts)]
    odd = events.recent(ODD_INPUT)
    if odd:
        causes.append((WARN, "odd input: " + ", ".join(odd)))
    return causes


def _silence(status: NodeStatus) -> list[Cause]:
    """Return the cause of an input without usable observations."""
    age, limit_s = status.input, status.input_timeout_s
    messages = f"{age.rejected} messages since were" if age.rejected > 1 else "1 message since was"
    rejected = f"{messages} rejected, the last one because of {age.reason}"
    if age.age_s > limit_s and age.usable:
        sentence = (
            f"input is stale: the last usable observation on {status.topic} came"
            f" {age.age_s:.1f} s ago, expected within {limit_s:g} s"
        )
        return [(ERROR, f"{sentence}; {rejected}" if age.rejected else sentence)]
    if age.age_s > limit_s and age.rejected:
        sentence = f"no usable observation has come on {status.topic} for {age.age_s:.1f} s"
        return [(ERROR, f"{sentence}: {rejected}")]
    if not age.usable and not status.waiting:
        what = "no usable observation" if age.rejected else "nothing"
        return [(WARN, f"{what} has come on {status.topic} yet")]
    return []


def standing_clock(age: InputAge, limit_s: float) -> list[Cause]:
    """Return the cause of a simulated clock that stands still.

    Args:
        age: of the input.
        limit_s: for so long it may stand (s).
    """
    if age.clock_stands_s <= limit_s:
        return []
    if not age.clock_seen:
        return [(WARN, "use_sim_time is set, but no time has come on /clock")]
    sentence = f"the simulated time on /clock has stood still for {age.clock_stands_s:.1f} s"
    return [(WARN, sentence)]


def _model(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    causes = not_active(status)
    if status.degraded:
        causes.append((ERROR, f"degraded, constant velocity serves: {status.degraded}"))
    if not causes:
        causes = _model_causes(status, events)
    level, message = worst_first(causes, _served(status))
    values = {
        **status.model,
        "agents": str(status.agents),
        "fallback_agents": str(status.fallback_agents),
        "overload": status.overload,
        "degraded": status.degraded,
    }
    values |= counted(events.counts(), [*BAD_MODEL, "agents_over_limit"])
    return make_status(f"{name}: model", level, message, values)


def _served(status: NodeStatus) -> str:
    """Return whom the model serves where nothing is wrong with it."""
    if status.idle:
        return "no prediction at present"
    if not status.agents:
        return "no agent to be predicted"
    if status.preferred_agents:
        return (
            f"constant velocity serves {status.preferred_agents} of {status.agents} agents, since"
            " it has been better"
        )
    return "the model serves every agent"


def _model_causes(status: NodeStatus, events: EventLog) -> list[Cause]:
    causes: list[Cause] = []
    failures = events.recent(BAD_MODEL)
    if status.without_model_in_a_row >= NEVER_KEEPS_UP and not status.idle:
        sentence = f"the model served no agent in {status.without_model_in_a_row} cycles in a row"
        causes.append((ERROR, sentence))
    if failures:
        causes.append((WARN, "constant velocity serves instead: " + ", ".join(failures)))
    causes += [(WARN, limitation) for limitation in status.limitations]
    level = ERROR if status.nothing_published else WARN
    causes += [(level, sentence) for sentence in status.left_out]
    if status.overload and not status.idle:
        causes.append((WARN, status.overload))
    if status.fallback_agents and not causes and not status.idle:
        sentence = f"constant velocity serves {status.fallback_agents} of {status.agents} agents"
        causes.append((WARN, sentence))
    return causes


def _timing(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    latency = status.latency.summary()
    level, message = worst_first(
        not_active(status) or _timing_causes(status, events),
        "no prediction at present" if status.idle else "on time",
    )
    values = {
        "period_ms": f"{status.period_ms:.1f}",
        "latency_ms_p50": f"{latency.p50:.3f}",
        "latency_ms_p99": f"{latency.p99:.3f}",
        "latency_ms_max": f"{latency.maximum:.3f}",
    }
    counters = ["predictions", *BAD_TIMING, "late_results_dropped"]
    values |= counted(events.counts(), counters)
    return make_status(f"{name}: timing", level, message, values)


def _timing_causes(status: NodeStatus, events: EventLog) -> list[Cause]:
    causes: list[Cause] = []
    if status.unanswered_s > max(UNANSWERED_S, 3e-3 * status.period_ms):
        sentence = f"an observation has had no prediction for {status.unanswered_s:.1f} s"
        causes.append((ERROR, sentence))
    if status.over_budget_in_a_row >= NEVER_KEEPS_UP and not status.idle:
        sentence = (
            f"the model does not keep up: {status.over_budget_in_a_row} cycles in a row were over"
            " budget; lower max_agents or rate"
        )
        causes.append((ERROR, sentence))
    bad = events.recent(BAD_TIMING)
    if bad:
        causes.append((WARN, ", ".join(bad)))
    return causes


def _quality(name: str, status: NodeStatus) -> DiagnosticStatus:
    causes = not_active(status)
    otherwise = "nothing is scored yet"
    if status.quality is not None:
        otherwise = status.quality.message
        if status.quality.level and not causes:
            causes = [(bytes([status.quality.level]), otherwise)]
    level, message = worst_first(causes, otherwise)
    return make_status(f"{name}: quality", level, message, status.quality_values)


def _calibration(name: str, status: NodeStatus) -> DiagnosticStatus:
    causes = not_active(status)
    if status.calibration_problem:
        causes.append((WARN, status.calibration_problem))
    if status.preferred:
        served = ", ".join(status.preferred)
        sentence = f"constant velocity has been better than the model and serves {served}"
        causes.append((WARN, sentence))
    level, message = worst_first(causes, status.calibration.get("calibration", ""))
    return make_status(f"{name}: calibration", level, message, status.calibration)


def counted(counts: Mapping[str, int], names: list[str]) -> dict[str, str]:
    """Return the values of a status for some counters, 0 for those that never counted."""
    return {name: str(counts.get(name, 0)) for name in names}


def make_status(
    name: str, level: bytes, message: str, values: Mapping[str, str]
) -> DiagnosticStatus:
    """Return a diagnostic status."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=shortened(message),
        values=[KeyValue(key=key, value=shortened(value)) for key, value in values.items()],
    )
