# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The clocks of the machine, set by the test."""

import pytest

from mtpgo_ros.runtime import clock_watch, receipt_clock

S_NS = 1_000_000_000


class Clocks:
    """Both clocks of the machine; ``late_ns`` passes between two looks at them."""

    def __init__(self):
        self.system_ns, self.machine_ns, self.late_ns = 1_700_000_000 * S_NS, 5000 * S_NS, 0

    def time_ns(self):
        self.pass_time(self.late_ns * 1e-9)
        return self.system_ns

    def monotonic_ns(self):
        return self.machine_ns

    def pass_time(self, seconds, *, rate=1.0):
        self.system_ns += round(seconds * rate * S_NS)
        self.machine_ns += round(seconds * S_NS)


@pytest.fixture
def clocks(monkeypatch):
    clocks = Clocks()
    for module in (clock_watch, receipt_clock):
        monkeypatch.setattr(module, "time", clocks)
    return clocks
