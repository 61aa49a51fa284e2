# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The diagnostics of the node: statuses for input, model, timing, quality and calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mtpgo_core.quality.quality_report import QualityVerdict
from mtpgo_ros.diagnostics.event_log import BAD_MODEL, BAD_TIMING, ODD_INPUT, EventLog
from mtpgo_ros.diagnostics.latency import LatencyStatistics

NEVER_KEEPS_UP = 3
"""Consecutive cycles over budget after which the model counts as too slow for this machine;
chosen: a single busy moment of the machine is shorter."""

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@dataclass
class NodeStatus:
    """The state of the node that is reported besides the counters; the node keeps it up to date.

    Attributes:
        topic: resolved name of the objects' topic.
        message_type: type subscribed to.
        waiting: what the subscription waits for, empty once it is subscribed.
        frame_id: frame of the last observation.
        input_age_s: time since the last observation came (s), None before the first.
        input_timeout_s: limit of ``input_age_s`` (s).
        frame_error: why the last observation could not be transformed into the fixed frame, empty
            if it was.
        degraded: why there is no model, empty if there is one.
        limitations: other reasons why the predictions are worse than they could be.
        overload: what the last prediction lacks because there are many agents, empty if nothing.
        agents: agents of the last prediction.
        fallback_agents: those of them predicted at constant velocity.
        over_budget_in_a_row: consecutive cycles over budget.
        period_ms: shortest time between two predictions (ms).
        latency: of the predictions.
        model: further values for the status of the model.
        quality: verdict on the scores of the predictions, None while there are no scores.
        quality_values: values for the status of the quality.
        calibration_problem: why the calibration file was not used or not written, empty if it was.
        preferred: groups that constant velocity serves because it has been better.
        calibration: values for the status of the calibration.
    """

    topic: str = ""
    message_type: str = ""
    waiting: str = ""
    frame_id: str = ""
    input_age_s: float | None = None
    input_timeout_s: float = 1.0
    frame_error: str = ""
    degraded: str = ""
    limitations: list[str] = field(default_factory=list)
    overload: str = ""
    agents: int = 0
    fallback_agents: int = 0
    over_budget_in_a_row: int = 0
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


def _input(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    counts = events.counts()
    odd = events.recent(ODD_INPUT)
    age_s, limit_s = status.input_age_s, status.input_timeout_s
    if status.waiting:
        level, message = WARN, status.waiting
    elif age_s is None:
        level, message = WARN, f"nothing has come on {status.topic} yet"
    elif age_s > limit_s:
        level = ERROR
        message = (
            f"input is stale: the last message on {status.topic} came {age_s:.1f} s ago, expected"
            f" within {limit_s:g} s"
        )
    elif status.frame_error:
        level, message = ERROR, status.frame_error
    elif odd:
        level, message = WARN, "odd input: " + ", ".join(odd)
    else:
        level, message = OK, "receiving"
    values = {
        "topic": status.topic,
        "type": status.message_type,
        "frame": status.frame_id,
        "age_s": "" if age_s is None else f"{age_s:.3f}",
    }
    values |= _counted(counts, ["messages", "empty_messages", "unknown_class", *ODD_INPUT])
    return make_status(f"{name}: input", level, message, values)


def _model(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    failures = events.recent(BAD_MODEL)
    if status.degraded:
        level, message = ERROR, f"degraded, constant velocity serves: {status.degraded}"
    elif failures:
        level, message = WARN, "constant velocity serves instead: " + ", ".join(failures)
    elif status.limitations:
        level, message = WARN, "; ".join(status.limitations)
    elif status.overload:
        level, message = WARN, status.overload
    elif status.fallback_agents:
        level = WARN
        message = f"constant velocity serves {status.fallback_agents} of {status.agents} agents"
    else:
        level, message = OK, "the model serves every agent"
    values = {
        **status.model,
        "agents": str(status.agents),
        "fallback_agents": str(status.fallback_agents),
        "overload": status.overload,
        "degraded": status.degraded,
    }
    values |= _counted(events.counts(), [*BAD_MODEL, "agents_over_limit"])
    return make_status(f"{name}: model", level, message, values)


def _calibration(name: str, status: NodeStatus) -> DiagnosticStatus:
    kind = status.calibration.get("calibration", "")
    reasons = [status.calibration_problem] if status.calibration_problem else []
    if status.preferred:
        reasons.append(
            "constant velocity has been better than the model and serves "
            + ", ".join(status.preferred)
        )
    level, message = (WARN, "; ".join(reasons)) if reasons else (OK, kind or "the node has none")
    return make_status(f"{name}: calibration", level, message, status.calibration)


def _timing(name: str, status: NodeStatus, events: EventLog) -> DiagnosticStatus:
    latency = status.latency.summary()
    bad = events.recent(BAD_TIMING)
    if status.over_budget_in_a_row >= NEVER_KEEPS_UP:
        level = ERROR
        message = (
            f"the model does not keep up: {status.over_budget_in_a_row} cycles in a row were over"
            " budget; lower max_agents or rate"
        )
    elif bad:
        level, message = WARN, ", ".join(bad)
    else:
        level, message = OK, "on time"
    values = {
        "period_ms": f"{status.period_ms:.1f}",
        "latency_ms_p50": f"{latency.p50:.3f}",
        "latency_ms_p99": f"{latency.p99:.3f}",
        "latency_ms_max": f"{latency.maximum:.3f}",
    }
    counters = ["predictions", *BAD_TIMING, "late_results_dropped"]
    values |= _counted(events.counts(), counters)
    return make_status(f"{name}: timing", level, message, values)


def _quality(name: str, status: NodeStatus) -> DiagnosticStatus:
    level, message = OK, "nothing is scored yet"
    if status.quality is not None:
        level, message = bytes([status.quality.level]), status.quality.message
    return make_status(f"{name}: quality", level, message, status.quality_values)


def _counted(counts: Mapping[str, int], names: list[str]) -> dict[str, str]:
    return {name: str(counts.get(name, 0)) for name in names}


def make_status(
    name: str, level: bytes, message: str, values: Mapping[str, str]
) -> DiagnosticStatus:
    """Return a diagnostic status."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
