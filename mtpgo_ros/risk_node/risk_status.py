# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The diagnostics of the node ``risk``: statuses for predictions, plan and result."""

from __future__ import annotations

from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_ros.diagnostics.diagnostic_status import (
    ACTIVE,
    ERROR,
    WARN,
    Cause,
    counted,
    make_status,
    not_active,
    standing_clock,
    worst_first,
)
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.input_watch import InputAge


@dataclass
class RiskStatus:
    """The state of the node, kept up to date by it.

    Attributes:
        state: of the life cycle, as in lifecycle_msgs/State.
        failure: why the last transition failed, empty if it did not.
        namesake: what is known about another node of the same name, empty without one.
        topic: resolved name of the predictions' topic.
        publishers: what is wrong with its publishers, empty if nothing is.
        input: age of the predictions.
        prediction_timeout_s: age from which on they are stale (s).
        prediction_problem: why the last predictions were not usable, empty if they were.
        prediction_warning: what the last predictions lack, empty if nothing.
        plan_topic: resolved name of the plan's topic.
        plan_publishers: what is wrong with its publishers, empty if nothing is.
        plan_problem: why there is no usable plan, empty if there is one.
        plan_warning: what the plan lacks, empty if nothing.
        plan_age_s: time from the plan to the observation of the last predictions (s), NaN without.
        agents: road users of the last result.
        unknown_agents: those of them whose risk is not known at any step.
        partly_known_agents: those whose risk is known at some steps only.
        peak: highest probability of the last result, NaN if nothing is known.
        peak_time_s: when it is (s after the observation).
        peak_agent: whose it is.
        occupancy_problem: why the occupancy grid is unknown, empty if it is not.
        occupancy_warning: what a known grid lacks, empty if nothing.
        processing_ms: time that the last result took (ms).
    """

    state: str = ACTIVE
    failure: str = ""
    namesake: str = ""
    topic: str = ""
    publishers: str = ""
    input: InputAge = field(default_factory=InputAge)
    prediction_timeout_s: float = 1.0
    prediction_problem: str = ""
    prediction_warning: str = ""
    plan_topic: str = ""
    plan_publishers: str = ""
    plan_problem: str = ""
    plan_warning: str = ""
    plan_age_s: float = float("nan")
    agents: int = 0
    unknown_agents: int = 0
    partly_known_agents: int = 0
    peak: float = float("nan")
    peak_time_s: float = float("nan")
    peak_agent: str = ""
    occupancy_problem: str = ""
    occupancy_warning: str = ""
    processing_ms: float = float("nan")

    def start_anew(self) -> None:
        """Forget what was found before, as at an activation."""
        vars(self).update(vars(RiskStatus()))


def risk_statuses(name: str, status: RiskStatus, events: EventLog) -> list[DiagnosticStatus]:
    """Return the three diagnostic statuses of the node ``name``."""
    counts = events.counts()
    inactive = not_active(status, "no risk")
    level, message = worst_first(inactive or _prediction_causes(status), "receiving")
    predictions = make_status(
        f"{name}: predictions",
        level,
        message,
        {
            "topic": status.topic,
            "age_s": f"{status.input.age_s:.3f}" if status.input.usable else "",
            **counted(counts, ["messages", "rejected"]),
        },
    )
    level, message = worst_first(inactive or _plan_causes(status), "there is a plan")
    plan = make_status(
        f"{name}: plan",
        level,
        message,
        {
            "topic": status.plan_topic,
            "plan_age_s": f"{status.plan_age_s:.3f}",
            **counted(counts, ["plans", "rejected_plans"]),
        },
    )
    level, message = worst_first(inactive or _result_causes(status), _result(status))
    result = make_status(
        f"{name}: result",
        level,
        message,
        {
            "agents": str(status.agents),
            "unknown_agents": str(status.unknown_agents),
            "partly_known_agents": str(status.partly_known_agents),
            "highest_risk": f"{status.peak:.4f}",
            "highest_risk_time_s": f"{status.peak_time_s:.2f}",
            "highest_risk_agent": status.peak_agent,
            "processing_ms": f"{status.processing_ms:.2f}",
        },
    )
    return [predictions, plan, result]


def _prediction_causes(status: RiskStatus) -> list[Cause]:
    causes = [(WARN, text) for text in (status.namesake, status.publishers) if text]
    age, limit_s = status.input, status.prediction_timeout_s
    causes += standing_clock(age, limit_s)
    if not age.usable and not age.rejected:
        if not status.publishers:
            causes.append((WARN, f"nothing has come on {status.topic} yet"))
    elif status.prediction_problem:
        causes.append((ERROR, status.prediction_problem))
    elif age.age_s > limit_s:
        sentence = (
            f"predictions are stale: the last ones on {status.topic} came {age.age_s:.1f} s ago,"
            f" expected within {limit_s:g} s; the risk is unknown"
        )
        causes.append((ERROR, sentence))
    elif status.prediction_warning:
        causes.append((WARN, status.prediction_warning))
    return causes


def _plan_causes(status: RiskStatus) -> list[Cause]:
    causes = [(WARN, status.plan_publishers)] if status.plan_publishers else []
    if status.plan_problem:
        causes.append((ERROR, f"{status.plan_problem}; the risk is unknown"))
    elif status.plan_warning:
        causes.append((WARN, status.plan_warning))
    return causes


def _result_causes(status: RiskStatus) -> list[Cause]:
    causes = []
    if status.unknown_agents:
        sentence = f"the risk of {status.unknown_agents} of {status.agents} road users is unknown"
        causes.append((ERROR, sentence))
    if status.partly_known_agents:
        sentence = (
            f"the risk of {status.partly_known_agents} of {status.agents} road users is known for"
            " a part of the horizon only"
        )
        causes.append((WARN, sentence))
    if status.occupancy_problem:
        causes.append((ERROR, status.occupancy_problem))
    if status.occupancy_warning:
        causes.append((WARN, status.occupancy_warning))
    return causes


def _result(status: RiskStatus) -> str:
    if not status.input.usable:
        return "no predictions have come yet"
    if not status.agents:
        return "no road user"
    return (
        f"highest risk {status.peak:.1%} in {status.peak_time_s:.1f} s"
        f" (road user {status.peak_agent})"
    )
