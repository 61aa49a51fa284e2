# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests to end a run: by time, by a signal, and a second signal that ends the process."""

import signal
import threading

import pytest

from mtpgo_training.training.interruption import SIGNALS, Interruption


@pytest.fixture(autouse=True)
def _usual_handlers():
    """As in a terminal: a shell starts background jobs with SIGINT ignored, nohup with SIGHUP."""
    before = [
        (signal.SIGINT, signal.signal(signal.SIGINT, signal.default_int_handler)),
        (signal.SIGHUP, signal.signal(signal.SIGHUP, signal.SIG_DFL)),
    ]
    yield
    for number, handler in before:
        signal.signal(number, handler)


def test_nothing_is_requested_without_a_signal():
    with Interruption() as interruption:
        assert not interruption.requested()
        assert interruption.received_signal is None


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_recorded_and_the_handlers_are_restored(number):
    before = {one: signal.getsignal(one) for one in SIGNALS}
    with Interruption() as interruption:
        signal.raise_signal(number)
        assert interruption.requested()
        assert interruption.received_signal == number
        # A second signal has its usual effect.
        assert {one: signal.getsignal(one) for one in SIGNALS} == before
    assert {one: signal.getsignal(one) for one in SIGNALS} == before


def test_a_second_interrupt_is_raised():
    with Interruption() as interruption:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert interruption.received_signal == signal.SIGINT


def test_another_thread_has_no_signals():
    before, found = signal.getsignal(signal.SIGINT), []

    def inside():
        with Interruption() as interruption:
            found.append(signal.getsignal(signal.SIGINT))
            found.append(interruption.received_signal)

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join(timeout=10.0)
    assert found == [before, None]


def test_a_terminal_may_be_closed_under_nohup():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGHUP)
            assert not interruption.requested()
    finally:
        signal.signal(signal.SIGHUP, before)
