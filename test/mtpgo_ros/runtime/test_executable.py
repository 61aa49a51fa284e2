# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Arguments, signals and exit status of the executables."""

import argparse
import contextlib
import os
import signal
import sys
import threading

import pytest

from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    Interrupted,
    answered,
    fail,
    interruptible,
    not_negative,
    positive,
    stop_on_signals,
    tell,
)


def test_an_error_is_one_line_on_stderr_and_status_two(capsys):
    assert fail("program", ValueError("no\n   good")) == 2
    assert capsys.readouterr().err == "program: no good\n"


@pytest.mark.parametrize("error", [False, True])
def test_a_line_to_a_closed_output_is_no_error(monkeypatch, error):
    name = "stderr" if error else "stdout"
    read, write = os.pipe()
    os.close(read)
    with open(write, "w", encoding="utf-8") as stream:
        monkeypatch.setattr(sys, name, stream)
        tell("into nowhere", error=error)
        tell("and again", error=error)
    monkeypatch.setattr(sys, name, None)  # as where the file is closed
    tell("into nothing", error=error)


def test_wrong_arguments_are_one_line(capsys):
    with pytest.raises(SystemExit) as caught:
        ArgumentParser(prog="program").parse_args(["--nope"])
    assert caught.value.code == 2
    said = "program: unrecognized arguments: --nope (see program --help)\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    ("line", "parameters", "example"),
    [
        ("-p rate:=5", True, "program --ros-args -p rate:=5"),
        ("rate:=5", False, "program --ros-args -p rate:=5"),
        ("--model default", True, "program --ros-args -p NAME:=VALUE"),
    ],
)
def test_parameters_without_ros_args_are_told_where_they_belong(capsys, line, parameters, example):
    with pytest.raises(SystemExit):
        ArgumentParser(prog="program", parameters=parameters).parse_args(line.split())
    said = f"unrecognized arguments: {line}, parameters follow --ros-args: {example} (see"
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_are_remembered(number):
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        stopped = stop_on_signals()
        assert not stopped()
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)
        assert stopped()
    finally:
        for n, handler in handlers.items():
            signal.signal(n, handler)


def test_numbers_of_the_command_line():
    assert (positive("0.5"), not_negative("0")) == (0.5, 0.0)
    for convert, text in ((positive, "0"), (not_negative, "-1"), (positive, "inf")):
        with pytest.raises(argparse.ArgumentTypeError, match=text):
            convert(text)
    with pytest.raises(argparse.ArgumentTypeError, match="'x' given, expected a finite number"):
        positive("x")


def test_without_ros_an_executable_says_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert answered("replay", ["--version"], ArgumentParser)
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        answered("replay", ["x.mcap"], ArgumentParser)
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("replay: rclpy is not installed")
    assert error.count("\n") == 1
    assert "mtpgo_ros[ros]" in error


@pytest.fixture
def requested(signals):
    """The signals as the executables have them, for the time of a test."""
    return stop_on_signals()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_step_of_the_start_and_no_other(requested, number):
    with interruptible():
        pass
    went_on = False

    def step():
        nonlocal went_on
        with interruptible():
            signal.raise_signal(number)
            went_on = True

    with pytest.raises(Interrupted):
        step()
    assert not went_on
    assert requested()
    signal.raise_signal(number)  # outside of such a step it is only remembered
    with pytest.raises(Interrupted), interruptible():
        pytest.fail("a step began after the signal")


def test_a_signal_that_a_library_swallows_ends_the_step_with_the_library(requested):
    def swallows(then):
        with contextlib.suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        then()

    with pytest.raises(Interrupted), interruptible():
        swallows(lambda: None)
    stop_on_signals()
    with pytest.raises(Interrupted), interruptible():
        swallows(lambda: 1 / 0)  # as an import that was begun cannot be repeated


def test_errors_of_a_step_without_a_signal_are_its_own(requested):
    with pytest.raises(ZeroDivisionError), interruptible():
        1 / 0  # noqa: B018
    assert not requested()


def test_steps_in_another_thread_are_not_interrupted(requested):
    signal.raise_signal(signal.SIGINT)
    done = []

    def step():
        with interruptible():
            done.append(True)

    thread = threading.Thread(target=step)
    thread.start()
    thread.join()
    assert done
