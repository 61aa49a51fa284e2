# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The diagnostics of a risk node that is not active."""

import pytest

from mtpgo_ros.diagnostics.diagnostic_status import ERROR, WARN
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.risk_node.risk_status import RiskStatus, risk_statuses


@pytest.mark.parametrize(
    ("state", "failure", "level", "part"),
    [
        ("inactive", "", WARN, "not active (inactive): no risk"),
        ("inactive", "no plan_type", ERROR, "the last transition failed: no plan_type"),
        ("finalized", "", ERROR, "no risk, the process has to be started again"),
    ],
)
def test_a_node_that_is_not_active(state, failure, level, part):
    for status in risk_statuses("risk", RiskStatus(state=state, failure=failure), EventLog()):
        assert status.level == level
        assert part in status.message
