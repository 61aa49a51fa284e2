# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages to a service manager, by a socket of the test."""

import os
import socket

import pytest

from mtpgo_ros.runtime import supervision
from mtpgo_ros.runtime.supervision import ServiceNotifier


@pytest.fixture
def manager(tmp_path):
    """The socket of a service manager."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one:
        one.bind(str(tmp_path / "notify"))
        one.settimeout(10.0)
        yield one


def test_states_are_reported_to_the_supervisor(manager):
    notifier = ServiceNotifier(manager.getsockname(), 3_000_000)
    assert notifier.watchdog_s == 1.5
    notifier.ready()
    notifier.alive()
    notifier.status("all\nwell")
    notifier.status("all\nwell")  # once
    notifier.stopping()
    heard = [manager.recv(100).decode() for _ in range(4)]
    assert heard == ["READY=1", "WATCHDOG=1", "STATUS=all well", "STOPPING=1"]


def test_signs_of_life_in_a_long_step_and_not_for_ever(manager, monkeypatch):
    notifier = ServiceNotifier(manager.getsockname(), 20_000)
    with notifier.long_step():
        assert [manager.recv(100) for _ in range(3)] == 3 * [b"WATCHDOG=1"]
    notifier.stopping()
    while manager.recv(100) == b"WATCHDOG=1":
        pass
    monkeypatch.setattr(supervision, "LONGEST_STEP_S", 0.0)
    with notifier.long_step():
        notifier.ready()
        assert manager.recv(100) == b"READY=1"
    with ServiceNotifier(manager.getsockname()).long_step():  # without a watchdog
        notifier.ready()
        assert manager.recv(100) == b"READY=1"


def test_an_abstract_address():
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one:
        one.bind(f"\0mtpgo_test_{os.getpid()}")
        one.settimeout(10.0)
        ServiceNotifier(f"@mtpgo_test_{os.getpid()}").ready()
        assert one.recv(100) == b"READY=1"


def test_without_a_manager_nothing_is_sent_and_a_lost_one_is_no_error(monkeypatch, tmp_path):
    for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
        monkeypatch.delenv(name, raising=False)
    notifier = ServiceNotifier.from_environment()
    assert notifier.watchdog_s == 0.0
    notifier.ready()
    ServiceNotifier(str(tmp_path / "gone")).ready()


@pytest.mark.parametrize(
    ("number", "process", "expected_s"),
    [("2000000", "", 1.0), ("2000000", "own", 1.0), ("2000000", "1", 0.0), ("soon", "", 0.0)],
)
def test_the_watchdog_of_the_environment(monkeypatch, number, process, expected_s):
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/none")
    monkeypatch.setenv("WATCHDOG_USEC", number)
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()) if process == "own" else process)
    assert ServiceNotifier.from_environment().watchdog_s == expected_s
