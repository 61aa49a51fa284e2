# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Completion of command lines: subcommands, options, names; nothing where no shell asks."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mtpgo_core.completion import complete, completed_by

ROOT = Path(__file__).resolve().parents[2]


def completions(line: str, module: str = "mtpgo_training.cli") -> set[str]:
    """What a shell that completes a line would offer."""
    code = (
        "import sys\n"
        f"from {module} import main\n"
        "import argcomplete\n"
        "real = argcomplete.autocomplete\n"
        "argcomplete.autocomplete = lambda parser: real("
        "parser, output_stream=sys.stdout, exit_method=sys.exit)\n"
        "main([])\n"
    )
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return {word.strip() for word in done.stdout.split("\n")}


def test_without_a_shell_that_asks_no_parser_is_built(monkeypatch):
    monkeypatch.delenv("_ARGCOMPLETE", raising=False)

    def build():
        raise AssertionError("a parser was built")

    complete(build)


def test_without_argcomplete_nothing_is_answered(monkeypatch):
    monkeypatch.setenv("_ARGCOMPLETE", "1")
    monkeypatch.setitem(sys.modules, "argcomplete", None)
    complete(argparse.ArgumentParser)


def test_names_are_looked_up_when_they_are_asked_for():
    asked = []

    def names():
        asked.append(True)
        return ["a", "b"]

    action = completed_by(argparse.ArgumentParser().add_argument("name"), names)
    assert not asked
    assert action.completer(prefix="") == ["a", "b"]


@pytest.mark.parametrize(
    ("line", "module", "expected"),
    [
        ("mtpgo cu", "mtpgo_training.cli", {"curve"}),
        ("mtpgo train mtp-go2-s-", "mtpgo_training.cli", {"mtp-go2-s-highd", "mtp-go2-s-ind"}),
        ("mtpgo train default --lay", "mtpgo_training.cli", {"--layout"}),
        ("replay --wait-for-", "mtpgo_ros.replay", {"--wait-for-subscribers"}),
    ],
)
def test_a_shell_is_offered_what_fits(line, module, expected):
    assert expected <= completions(line, module)
