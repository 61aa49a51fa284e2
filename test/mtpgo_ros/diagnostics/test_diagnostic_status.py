# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The levels and values of the four statuses."""

from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_core.quality.quality_report import Level, QualityVerdict
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus, diagnostic_statuses
from mtpgo_ros.diagnostics.event_log import EventLog

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def levels(status, events):
    return [found.level for found in diagnostic_statuses("predictor", status, events)]


def test_levels_of_the_diagnostic_statuses():
    status = NodeStatus(topic="/objects", waiting="the node is not active")
    events = EventLog()
    assert levels(status, events) == [WARN, OK, OK, OK, OK]
    status.waiting = ""
    assert levels(status, events) == [WARN, OK, OK, OK, OK]  # nothing has come yet
    status.input_age_s = 0.1
    assert levels(status, events) == [OK, OK, OK, OK, OK]
    status.input_age_s = 1.1
    assert levels(status, events) == [ERROR, OK, OK, OK, OK]
    status.input_age_s, status.frame_error = 0.1, "no odometry"
    assert levels(status, events) == [ERROR, OK, OK, OK, OK]
    status.frame_error = ""
    events.count("late")
    events.count("cycles_skipped")
    assert levels(status, events) == [WARN, OK, WARN, OK, OK]
    status.over_budget_in_a_row = 3
    assert levels(status, events) == [WARN, OK, ERROR, OK, OK]
    status.fallback_agents = 1
    assert levels(status, events)[1] == WARN
    status.degraded = "no file"
    assert levels(status, events)[1] == ERROR
    status.quality = QualityVerdict(Level.WARN, "bad")
    assert levels(status, events)[3] == WARN
    status.preferred = ["vehicle_moving"]
    assert levels(status, events)[4] == WARN
    status.preferred, status.calibration_problem = [], "the file is damaged"
    assert levels(status, events)[4] == WARN


def test_every_counter_is_reported_from_the_start():
    found = diagnostic_statuses("predictor", NodeStatus(), EventLog())
    assert [status.name for status in found] == [
        "predictor: input",
        "predictor: model",
        "predictor: timing",
        "predictor: quality",
        "predictor: calibration",
    ]
    values = {pair.key: pair.value for status in found for pair in status.values}
    for name in ("messages", "late", "clock_reset", "deadline_misses", "model_failures"):
        assert values[name] == "0"
