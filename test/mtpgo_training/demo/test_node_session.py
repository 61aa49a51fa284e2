# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the demo says of the node's log."""

from mtpgo_training.demo.node_session import warnings_of

LOG = """[INFO] [1795949654.1] [predictor]: [WARN] is a level
[WARN] [1795949654.693813702] [predictor]: parameter nosuch has no effect: no such parameter
[WARN] [1795949655.0] [robot1.predictor]: stale
[WARN] [1795949656.0] [robot1.predictor]: stale
[ERROR] [1795949656.5] [predictor]: ended
[WARN] [1795949657.0] [predictor]: cut off at the e"""


def test_each_warning_of_the_node_is_said_once():
    assert warnings_of(LOG) == [
        "parameter nosuch has no effect: no such parameter",
        "stale",
        "cut off at the e",
    ]
    assert warnings_of("") == []
