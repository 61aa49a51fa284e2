# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Commands that are printed as the next step: they can be pasted into a shell as they are."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence


def command_text(*words: object) -> str:
    """Return a command line, quoted for a shell."""
    return shlex.join([str(word) for word in words])


def same_command(args: argparse.Namespace, *more: str, without: Sequence[str] = ()) -> str:
    """Return the command line that was given, quoted for a shell.

    Args:
        args: parsed by :func:`mtpgo_training.cli.main`, which notes the words as ``words``.
        more: words added, unless they were given.
        without: options with one value that are left out.
    """
    words = list(getattr(args, "words", []))
    kept: list[str] = []
    skip = False
    for word in words:
        if skip:
            skip = False
            continue
        name, equals, _ = word.partition("=")
        # argparse takes unambiguous beginnings of an option as well.
        if any(len(name) > 3 and option.startswith(name) for option in without):
            skip = not equals
            continue
        kept.append(word)
    ends = kept.index("--") if "--" in kept else len(kept)
    added = [word for word in more if word not in kept]
    # Behind a lone -- there are no options.
    return command_text("mtpgo", *kept[:ends], *added, *kept[ends:])
