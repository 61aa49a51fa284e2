# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Completion of command lines in a shell, by argcomplete where that is installed."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable

ASKED = "_ARGCOMPLETE"
"""Environment variable that a shell sets when it asks for completions; argcomplete's."""


def complete(build: Callable[[], argparse.ArgumentParser]) -> None:
    """Answer a shell that asks for completions, and exit; do nothing otherwise.

    Args:
        build: returns the parser of the program.
    """
    if ASKED not in os.environ:
        return
    try:
        import argcomplete
    except ModuleNotFoundError:
        return
    argcomplete.autocomplete(build())


def words_so_far() -> list[str]:
    """Return the words of the command line that is being completed, without the program."""
    return os.environ.get("COMP_LINE", "").split()[1:]


def completed_by(action: argparse.Action, names: Callable[[], Iterable[str]]) -> argparse.Action:
    """Let values of an argument be completed by names, besides files.

    Args:
        action: the argument.
        names: called when a shell asks.

    Returns:
        The argument.
    """

    def completer(**_: object) -> list[str]:
        return [str(name) for name in names()]

    action.completer = completer  # type: ignore[attr-defined]  # what argcomplete looks for
    return action
