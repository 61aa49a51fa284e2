# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interrupts that wait for the end of a block."""

import signal

import pytest

from mtpgo_training.parallel.late_interrupt import interrupt_afterwards


@pytest.fixture(autouse=True)
def handler():
    """The handler of a command."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def interrupted(times, done):
    """A block that is interrupted some times, and notes that it came to its end."""
    with interrupt_afterwards():
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        done.append(True)


@pytest.mark.parametrize(("times", "expected"), [(1, [True]), (2, [])])
def test_the_first_interrupt_waits_for_the_end_and_the_second_does_not(handler, times, expected):
    done = []
    with pytest.raises(KeyboardInterrupt):
        interrupted(times, done)
    assert done == expected
    assert signal.getsignal(signal.SIGINT) is handler


def test_an_error_in_the_block_is_told(handler):
    with pytest.raises(ValueError, match="no process"), interrupt_afterwards():
        raise ValueError("no process")
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_handler_of_others_is_kept():
    seen = []
    signal.signal(signal.SIGINT, lambda *_: seen.append(True))
    with interrupt_afterwards():
        signal.raise_signal(signal.SIGINT)
        assert seen == [True]
