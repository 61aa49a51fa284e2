# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values of command-line options: conversion functions for ``type=`` of argparse."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

from mtpgo_core.errors import ConfigurationError

LEARNING_RATE = "optimisation.learning_rate"
"""Key of the configuration that ``--find-lr`` is another way to."""


def positive_integer(text: str) -> int:
    """Return an integer of at least 1.

    Raises:
        argparse.ArgumentTypeError: the text is not one.
    """
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is given, expected at least 1")
    return number


def positive_number(text: str) -> float:
    """Return a finite number above 0.

    Raises:
        argparse.ArgumentTypeError: the text is not one.
    """
    number = _number(text)
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is given, expected a number above 0")
    return number


def share(text: str) -> float:
    """Return a share from 0 to 0.9, which leaves something for the rest.

    Raises:
        argparse.ArgumentTypeError: the text is not one.
    """
    number = _number(text)
    if not 0.0 <= number <= 0.9:
        raise argparse.ArgumentTypeError(f"{text} is given, expected a number from 0 to 0.9")
    return number


def require_given(given: Mapping[str, object], unless: str) -> None:
    """Check that arguments are given which another one makes unnecessary.

    Args:
        given: name and value of each argument.
        unless: the option with which they need not be given.

    Raises:
        ConfigurationError: one is missing.
    """
    missing = next((name for name, value in given.items() if not value), None)
    if missing is not None:
        raise ConfigurationError(f"{missing} is not given, expected it unless with {unless}")


def require_none(given: Mapping[str, bool], beside: str, why: str) -> None:
    """Check that no option is given which another one leaves without an effect.

    Args:
        given: name of each option, and whether it is given.
        beside: the other one.
        why: what of it leaves them without one, the end of the sentence.

    Raises:
        ConfigurationError: one is given.
    """
    found = next((name for name, value in given.items() if value), None)
    if found is not None:
        raise ConfigurationError(f"{found} is given with {beside}, {why}")


def require_one_budget(kind: str, minutes: float | None, steps: int | None) -> None:
    """Check that a training gets minutes or steps.

    Args:
        kind: what the options end with, such as ``fold``.
        minutes: of ``--minutes-per-KIND``.
        steps: of ``--steps-per-KIND``.

    Raises:
        ConfigurationError: both are given.
    """
    if minutes is not None and steps is not None:
        raise ConfigurationError(
            f"--minutes-per-{kind} and --steps-per-{kind} are given, expected one"
        )


def require_one_rate(find_lr: bool, settings: Iterable[str], option: str) -> None:
    """Check that a learning rate is not given where a range test is to find one.

    Args:
        find_lr: ``--find-lr``.
        settings: ``KEY=VALUE`` each.
        option: that they are given with.

    Raises:
        ConfigurationError: it is, and would have no effect.
    """
    if find_lr and any(word.partition("=")[0] == LEARNING_RATE for word in settings):
        raise ConfigurationError(
            f"{LEARNING_RATE} is given with {option} and --find-lr, which finds one, expected one "
            "of them"
        )


def make_folder(option: str, folder: Path) -> None:
    """Make the folder that an option names, unless it is there.

    Raises:
        ConfigurationError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"{option} is {folder}, which cannot be made: {error.strerror}"
        ) from error


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
