# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the node says about itself: three statuses for input, model and timing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from mtpgo_ros.diagnostics.counters import Statistics

ODD_INPUT = {
    "malformed": "messages that could not be read",
    "skipped_objects": "objects that could not be read",
    "non_finite": "objects without a finite position",
    "too_fast": "objects faster than possible",
    "duplicate_keys": "identities twice in a message",
    "duplicates": "objects with a repeated stamp",
    "late": "objects older than what is known",
    "restarted": "tracks begun anew after an impossible move",
    "dropped": "tracks dropped for lack of room",
    "unstamped": "messages without a stamp",
    "future_stamp": "messages ahead of the clock",
    "clock_reset": "jumps of the clock backwards",
    "frame_changed": "messages in another frame",
    "wrong_frame": "objects in another frame",
    "not_lifted": "messages that could not be lifted into the fixed frame",
    "qos_incompatible": "publishers with an incompatible QoS",
    "messages_lost": "messages lost by the middleware",
    "delay_not_compensated": "delays too long to be compensated",
}
"""Counters of input that is not as it should be, with their wording."""

BAD_TIMING = {
    "deadline_misses": "deadlines missed",
    "over_budget": "cycles over budget, answered by constant velocity",
    "cycles_skipped": "cycles skipped for a newer state",
    "cycles_failed": "cycles without a prediction",
}
"""Counters of cycles that did not go as they should, with their wording."""

BAD_MODEL = {
    "model_failures": "failures of the model",
    "non_finite_output": "agents with a model output that was not finite",
}
"""Counters of the model's failures, with their wording."""

NEVER_KEEPS_UP = 3
"""Cycles over budget in a row from which on the model counts as too slow for this machine."""

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@dataclass
class Facts:
    """What is reported beside the counters; the node keeps it up to date.

    Attributes:
        topic: resolved name of the objects' topic.
        message_type: type subscribed to.
        waiting: what the input waits for, empty once it is subscribed.
        frame_id: frame of the last observation.
        input_age_s: time since the last observation came (s), None before the first.
        input_timeout_s: limit for it (s).
        frame_error: why the last observation could not be lifted, empty if it was.
        degraded: why the model cannot serve at all, empty if it can.
        notes: other reasons why the predictions are worse than they could be.
        agents: agents of the last prediction.
        fallback_agents: those of them that constant velocity served.
        over_budget_in_a_row: cycles.
        values: further pairs for the status of the model.
    """

    topic: str = ""
    message_type: str = ""
    waiting: str = ""
    frame_id: str = ""
    input_age_s: float | None = None
    input_timeout_s: float = 1.0
    frame_error: str = ""
    degraded: str = ""
    notes: list[str] = field(default_factory=list)
    agents: int = 0
    fallback_agents: int = 0
    over_budget_in_a_row: int = 0
    period_ms: float = 200.0
    values: dict[str, str] = field(default_factory=dict)


def statuses(name: str, facts: Facts, statistics: Statistics) -> list[DiagnosticStatus]:
    """The three statuses of the node ``name``."""
    return [
        _input(name, facts, statistics),
        _model(name, facts, statistics),
        _timing(name, facts, statistics),
    ]


def _input(name: str, facts: Facts, statistics: Statistics) -> DiagnosticStatus:
    counts = statistics.counts()
    odd = statistics.recent(ODD_INPUT)
    age_s, limit_s = facts.input_age_s, facts.input_timeout_s
    if facts.waiting:
        level, message = WARN, facts.waiting
    elif age_s is None:
        level, message = WARN, f"nothing has come on {facts.topic} yet"
    elif age_s > limit_s:
        level = ERROR
        message = (
            f"input is stale: the last message on {facts.topic} came {age_s:.1f} s ago, expected"
            f" within {limit_s:g} s"
        )
    elif facts.frame_error:
        level, message = ERROR, facts.frame_error
    elif odd:
        level, message = WARN, "odd input: " + ", ".join(odd)
    else:
        level, message = OK, "receiving"
    values = {
        "topic": facts.topic,
        "type": facts.message_type,
        "frame": facts.frame_id,
        "age_s": "" if age_s is None else f"{age_s:.3f}",
    }
    values |= _counted(counts, ["messages", "empty_messages", "unknown_class", *ODD_INPUT])
    return _status(f"{name}: input", level, message, values)


def _model(name: str, facts: Facts, statistics: Statistics) -> DiagnosticStatus:
    failures = statistics.recent(BAD_MODEL)
    if facts.degraded:
        level, message = ERROR, f"degraded, constant velocity serves: {facts.degraded}"
    elif failures:
        level, message = WARN, "constant velocity stood in: " + ", ".join(failures)
    elif facts.notes:
        level, message = WARN, "; ".join(facts.notes)
    elif facts.fallback_agents:
        level = WARN
        message = f"constant velocity serves {facts.fallback_agents} of {facts.agents} agents"
    else:
        level, message = OK, "the model serves every agent"
    values = {
        **facts.values,
        "agents": str(facts.agents),
        "fallback_agents": str(facts.fallback_agents),
        "degraded": facts.degraded,
    }
    values |= _counted(statistics.counts(), [*BAD_MODEL, "agents_over_limit"])
    return _status(f"{name}: model", level, message, values)


def _timing(name: str, facts: Facts, statistics: Statistics) -> DiagnosticStatus:
    latency = statistics.latency()
    bad = statistics.recent(BAD_TIMING)
    if facts.over_budget_in_a_row >= NEVER_KEEPS_UP:
        level = ERROR
        message = (
            f"the model does not keep up: {facts.over_budget_in_a_row} cycles in a row were over"
            " budget; lower max_agents or rate"
        )
    elif bad:
        level, message = WARN, ", ".join(bad)
    else:
        level, message = OK, "on time"
    values = {
        "period_ms": f"{facts.period_ms:.1f}",
        "latency_ms_p50": f"{latency.p50:.3f}",
        "latency_ms_p99": f"{latency.p99:.3f}",
        "latency_ms_max": f"{latency.maximum:.3f}",
    }
    counters = ["predictions", *BAD_TIMING, "late_results_dropped"]
    values |= _counted(statistics.counts(), counters)
    return _status(f"{name}: timing", level, message, values)


def _counted(counts: Mapping[str, int], names: list[str]) -> dict[str, str]:
    return {name: str(counts.get(name, 0)) for name in names}


def _status(name: str, level: bytes, message: str, values: dict[str, str]) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
