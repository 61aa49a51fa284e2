# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The argument parsers of all commands, for the page of commands and for tests of the pages."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from mtpgo_ros import record, replay
from mtpgo_training.cli import COMMANDS, build_parser

Named = tuple[str, str, argparse.ArgumentParser]
"""Command with its subcommands, one sentence, and parser."""


def all_parsers() -> list[Named]:
    """Return the commands of ``mtpgo`` with their subcommands, ``replay`` and ``record``."""
    found = [
        (f"mtpgo {name}", text, subparsers_of(build_parser(name))[name])
        for name, text in COMMANDS.items()
    ]
    commands = [item for parent in found for item in _with_subcommands(*parent)]
    for name, module in (("replay", replay), ("record", record)):
        parser = module._parser()
        commands.append((name, (parser.description or "").partition(": ")[2].rstrip("."), parser))
    return commands


def subparsers_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of a parser's subcommands by their names, none if it has none."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def _with_subcommands(name: str, text: str, parser: argparse.ArgumentParser) -> Iterator[Named]:
    yield name, text, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for word, inner in action.choices.items():
                yield from _with_subcommands(f"{name} {word}", helps.get(word, ""), inner)
