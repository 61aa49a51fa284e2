# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interrupts that wait for the end of a block."""

import contextlib
import signal
from dataclasses import dataclass

import pytest

from mtpgo_training.parallel import work_pool
from mtpgo_training.parallel.late_interrupt import interrupt_afterwards
from mtpgo_training.parallel.pool_options import PoolOptions


@dataclass(frozen=True)
class Item:
    """Something to work on."""

    name: str


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


@pytest.mark.usefixtures("handler")
def test_an_interrupt_while_processes_start_closes_them_when_they_have(monkeypatch):
    pytest.importorskip("distributed")
    seen = []

    @contextlib.contextmanager
    def processes(number):
        signal.raise_signal(signal.SIGINT)
        seen.append(f"{number} started")
        try:
            yield None
        finally:
            seen.append("closed")

    monkeypatch.setattr(work_pool, "_processes", processes)
    monkeypatch.setattr("distributed.Client", contextlib.nullcontext)
    with pytest.raises(KeyboardInterrupt):
        next(work_pool.work_through(str, [Item("a"), Item("b")], PoolOptions(jobs=2)))
    assert seen == ["2 started", "closed"]
