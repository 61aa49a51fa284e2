# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The time that a message has waited, by clocks that the test sets."""

import pytest

from mtpgo_ros.runtime.receipt_clock import ReceiptClock

S_NS = 1_000_000_000


@pytest.mark.parametrize("waited_s", [0.0, 0.02, 0.9, 2.0, 10.0])
def test_the_time_in_the_queue_counts_however_long_it_was(clocks, waited_s):
    receipt, received_ns, expected_ns = ReceiptClock(), clocks.system_ns, clocks.machine_ns
    clocks.pass_time(waited_s)
    assert receipt.monotonic_ns(received_ns) == expected_ns


@pytest.mark.parametrize("set_by_s", [-3600.0, -0.2, 0.2, 3600.0])
def test_a_system_clock_that_was_set_says_nothing_about_the_wait(clocks, set_by_s):
    receipt, received_ns = ReceiptClock(), clocks.system_ns
    clocks.system_ns += round(set_by_s * S_NS)
    clocks.pass_time(0.02)
    assert receipt.monotonic_ns(received_ns) == clocks.machine_ns
    received_ns = clocks.system_ns
    clocks.pass_time(0.03)
    assert receipt.monotonic_ns(received_ns) == clocks.machine_ns - round(0.03 * S_NS)


def test_an_unknown_time_and_one_in_the_future_are_now(clocks):
    receipt = ReceiptClock()
    assert receipt.monotonic_ns(0) == clocks.machine_ns
    assert receipt.monotonic_ns(clocks.system_ns + S_NS) == clocks.machine_ns


@pytest.mark.parametrize("set_by_s", [0.2, 3600.0])
def test_of_several_messages_that_waited_while_the_clock_was_set_none_is_older(clocks, set_by_s):
    receipt, received_ns = ReceiptClock(), [clocks.system_ns]
    clocks.pass_time(0.01)
    received_ns.append(clocks.system_ns)
    clocks.system_ns += round(set_by_s * S_NS)
    clocks.pass_time(0.02)
    set_ns = clocks.machine_ns
    for one_ns in received_ns:
        assert receipt.monotonic_ns(one_ns) == set_ns
        clocks.pass_time(0.01)
