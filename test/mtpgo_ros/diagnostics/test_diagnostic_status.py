# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The levels and values of the five statuses."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_core.quality.quality_report import Level, QualityVerdict
from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus, diagnostic_statuses
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.input_watch import InputAge

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def levels(status, events):
    return [found.level for found in diagnostic_statuses("predictor", status, events)]


def sentence(status, number, events=None):
    return diagnostic_statuses("predictor", status, events or EventLog())[number].message


@pytest.fixture
def status():
    """An active node with usable input."""
    return NodeStatus(topic="/objects", input=InputAge(usable=True, age_s=0.1))


@pytest.mark.parametrize(
    ("state", "failure", "level"),
    [
        ("unconfigured", "", WARN),
        ("inactive", "", WARN),
        ("finalized", "", ERROR),
        ("unconfigured", "no file", ERROR),
    ],
)
def test_a_node_that_is_not_active_says_so_in_every_status(status, state, failure, level):
    status.state, status.failure = state, failure
    assert levels(status, EventLog()) == [level] * 5
    for number in range(5):
        assert state in sentence(status, number)
        assert failure in sentence(status, number)


def test_silence_is_not_hidden_by_anything(status):
    status.input = InputAge(usable=True, age_s=1.1)
    assert levels(status, EventLog())[0] == ERROR
    # A wrong type that came and went, or is still there, changes nothing.
    status.waiting = "a publisher of std_msgs/msg/String"
    assert levels(status, EventLog())[0] == ERROR
    assert sentence(status, 0).endswith("; a publisher of std_msgs/msg/String")


def test_an_output_that_is_left_out_is_reported(status):
    status.agents, status.left_out = 3, ["output autoware is left out: no package"]
    assert levels(status, EventLog())[1] == WARN
    assert "no package" in sentence(status, 1)
    status.nothing_published = True
    assert levels(status, EventLog())[1] == ERROR


def test_before_the_first_observation(status):
    status.input = InputAge(age_s=60.0)
    assert levels(status, EventLog())[0] == WARN
    assert "nothing has come on /objects yet" in sentence(status, 0)
    status.input = InputAge(age_s=1.1, rejected=5, reason="messages without a stamp")
    assert levels(status, EventLog())[0] == ERROR
    assert "5 messages" in sentence(status, 0)
    assert "without a stamp" in sentence(status, 0)
    status.input = InputAge(age_s=0.9, rejected=5, reason="messages without a stamp")
    assert levels(status, EventLog())[0] == WARN


def test_an_input_of_which_everything_is_rejected_is_stale(status):
    status.input = InputAge(usable=True, age_s=1.1, rejected=20, reason="objects without a place")
    assert levels(status, EventLog())[0] == ERROR
    assert "20 messages since were rejected" in sentence(status, 0)
    assert "objects without a place" in sentence(status, 0)


def test_a_simulated_clock_that_stands_still(status):
    status.input = InputAge(usable=True, age_s=0.0, clock_stands_s=1.5)
    assert levels(status, EventLog())[0] == WARN
    assert "/clock has stood still for 1.5 s" in sentence(status, 0)
    status.input = InputAge(usable=True, age_s=4.0, clock_stands_s=4.0)
    assert levels(status, EventLog())[0] == ERROR
    status.input = InputAge(age_s=4.0, clock_stands_s=4.0, clock_seen=False)
    assert levels(status, EventLog())[0] == WARN
    assert "no time has come on /clock" in sentence(status, 0)


def test_every_other_cause_of_a_level_and_its_end(status):
    events = EventLog()
    assert levels(status, events) == [OK, OK, OK, OK, OK]
    status.frame_error = "no odometry"
    assert levels(status, events) == [ERROR, OK, OK, OK, OK]
    status.frame_error = ""
    status.frame_problems = ["a frame that moves"]
    assert levels(status, events) == [WARN, OK, OK, OK, OK]
    status.frame_problems = []
    status.namesake = "another node"
    assert levels(status, events) == [WARN, OK, OK, OK, OK]
    status.namesake = ""
    events.count("late")
    events.count("cycles_skipped")
    assert levels(status, events) == [WARN, OK, WARN, OK, OK]
    events = EventLog()
    status.over_budget_in_a_row = 3
    assert levels(status, events) == [OK, OK, ERROR, OK, OK]
    status.idle = True  # the cycles over budget are past
    assert levels(status, events) == [OK, OK, OK, OK, OK]
    status.over_budget_in_a_row, status.idle = 0, False
    status.unanswered_s = 1.1
    assert levels(status, events) == [OK, OK, ERROR, OK, OK]
    status.unanswered_s = 0.0
    status.agents = status.fallback_agents = 1
    assert levels(status, events)[1] == WARN
    status.without_model_in_a_row = 3
    assert levels(status, events)[1] == ERROR
    status.idle = True
    assert levels(status, events)[1] == OK
    status.degraded = "no file"
    assert levels(status, events)[1] == ERROR
    status.quality = QualityVerdict(Level.WARN, "bad")
    assert levels(status, events)[3] == WARN
    status.preferred = ["vehicle_moving"]
    assert levels(status, events)[4] == WARN
    status.preferred, status.calibration_problem = [], "the file is damaged"
    assert levels(status, events)[4] == WARN


def test_without_road_users_the_model_does_not_claim_to_serve(status):
    assert sentence(status, 1) == "no agent to be predicted"
    status.agents = 3
    assert sentence(status, 1) == "the model serves every agent"
    status.preferred_agents = 2
    assert sentence(status, 1).startswith("constant velocity serves 2 of 3 agents")
    status.idle = True
    assert sentence(status, 1) == "no prediction at present"


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


def test_texts_as_long_as_a_message_are_cut_off(status):
    status.ego_problem = status.frame_id = "x" * 1_000_000
    found = diagnostic_statuses("predictor", status, EventLog())[0]
    assert max(map(len, [found.message, *(pair.value for pair in found.values)])) < 5000
