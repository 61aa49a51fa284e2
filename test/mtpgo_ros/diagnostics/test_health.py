# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The one verdict, by clocks that the test sets."""

from datetime import UTC, datetime, timedelta

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_ros.diagnostics.health import HOLD_S, HealthMonitor

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)


class Setup:
    """A monitor whose time the test sets."""

    def __init__(self):
        self.now = 0.0
        self.monitor = HealthMonitor(lambda: self.now, lambda: BEGIN + timedelta(seconds=self.now))

    def show(self, input_level=OK, model_level=OK, state="active", word="said"):
        statuses = [
            DiagnosticStatus(name="a: input", level=input_level, message=f"input {word}"),
            DiagnosticStatus(name="a: model", level=model_level, message=f"model {word}"),
        ]
        return self.monitor.verdict(statuses, state)


@pytest.fixture
def setup():
    return Setup()


def test_the_worst_status_decides(setup):
    verdict = setup.show()
    assert (verdict.level, verdict.cause) == (OK, "")
    assert verdict.sentence == "input said; model said"
    verdict = setup.show(input_level=WARN)
    assert (verdict.level, verdict.cause, verdict.sentence) == (WARN, "input", "input said")
    verdict = setup.show(input_level=WARN, model_level=ERROR)
    assert (verdict.level, verdict.cause) == (ERROR, "model")
    assert verdict.sentence == "model said; input said"


def test_it_becomes_better_only_after_a_while(setup):
    setup.show(input_level=ERROR)
    setup.now = HOLD_S
    assert setup.show().level == ERROR
    setup.now += 0.1
    verdict = setup.show()
    assert (verdict.level, verdict.for_s) == (OK, 0.0)
    assert verdict.since == BEGIN + timedelta(seconds=HOLD_S + 0.1)


def test_a_fault_that_comes_and_goes_is_one_fault(setup):
    for step in range(40):
        setup.now = 0.5 * step
        verdict = setup.show(model_level=WARN if step % 4 else ERROR, word=str(step))
        assert (verdict.level, verdict.since, verdict.cause) == (ERROR, BEGIN, "model")
    assert verdict.for_s == 19.5
    assert verdict.sentence == "model 36"  # the last sentence of that level


def test_of_equal_levels_the_first_status_is_reported_first_whichever_began_first(setup):
    setup.show(model_level=WARN)
    for step in range(10):
        setup.now = 0.1 * step
        verdict = setup.show(input_level=WARN, model_level=WARN)
        assert (verdict.cause, verdict.sentence) == ("input", "input said; model said")


def test_a_status_whose_fault_has_become_less_is_reported_once(setup):
    setup.show(input_level=ERROR, word="lost")
    verdict = setup.show(input_level=WARN, word="odd")
    assert (verdict.level, verdict.sentence) == (ERROR, "input lost")


def test_what_is_over_is_not_said_beside_something_worse(setup):
    setup.show(input_level=WARN, word="nothing has come")
    verdict = setup.show(model_level=ERROR)
    assert (verdict.level, verdict.sentence) == (ERROR, "model said")
    assert setup.show().sentence == "model said"


def test_a_sentence_that_all_statuses_have_is_reported_once():
    statuses = [DiagnosticStatus(name=f"a: {n}", level=WARN, message="off") for n in ("b", "c")]
    assert HealthMonitor().verdict(statuses, "inactive").sentence == "off"


def test_a_change_of_state_forgets_what_it_has_ended(setup):
    assert setup.show(input_level=WARN, state="inactive").level == WARN
    assert setup.show(state="active").level == OK


def test_the_message(setup):
    setup.show(input_level=WARN)
    setup.now = 2.0
    message = setup.show(input_level=WARN).message("robot1/predictor")
    assert (message.name, message.level) == ("robot1/predictor: health", WARN)
    assert message.message == "input said"
    assert {pair.key: pair.value for pair in message.values} == {
        "state": "active",
        "cause": "input",
        "since": "2026-01-01T00:00:00.000+00:00",
        "for_s": "2.0",
    }
