# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Completion of command lines: subcommands, options, names; nothing where no shell asks."""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mtpgo_core.completion import complete, completed_by
from mtpgo_training.cli import COMMANDS, EXTRA_MODULES

ROOT = Path(__file__).resolve().parents[2]


CLI = "mtpgo_training.cli"
OFFERED = {
    ("mtpgo cu", CLI): {"curve"},
    ("mtpgo train mtp-go2-s-", CLI): {"mtp-go2-s-highd", "mtp-go2-s-ind"},
    ("mtpgo train default --lay", CLI): {"--layout"},
    ("mtpgo data --layout n", CLI): {"ngsim", "nuscenes"},
    ("mtpgo convert a", CLI): {"argoverse2"},
    ("mtpgo simulate ro", CLI): {"roundabout", "roundabouts"},
    ("mtpgo evaluate --model d", CLI): {"default"},
    **{(f"mtpgo {name} --h", CLI): {"--help"} for name in COMMANDS},
    **{
        (f"{name} --vers", f"mtpgo_ros.{name}"): {"--version"}
        for name in ("predictor", "replay", "record", "risk", "load_generator")
    },
    ("replay --wait-for-", "mtpgo_ros.replay"): {"--wait-for-subscribers"},
}
"""Line and module of the program -> some of what a shell is offered."""

HEAVY = {*EXTRA_MODULES, "filelock", "mcap", "pandas", "rosbags", "torch"}
"""Modules that take longer to import than a user waits for a completion."""

ANSWER = """
import importlib, io, json, os, sys
import argcomplete

real = argcomplete.autocomplete
answers = []
for line, module in json.loads(sys.argv[1]):
    os.environ.update(COMP_LINE=line, COMP_POINT=str(len(line)))
    stream = io.StringIO()
    argcomplete.autocomplete = lambda parser: real(
        parser, output_stream=stream, exit_method=sys.exit
    )
    try:
        importlib.import_module(module).main([])
    except SystemExit:
        pass
    modules = {name.partition(".")[0] for name in sys.modules}
    answers.append([stream.getvalue().split("\\n"), sorted(modules)])
print(json.dumps(answers))
"""


@pytest.fixture(scope="module")
def answers():
    """Line and module -> what a shell would be offered, and the modules loaded until then."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
    }
    done = subprocess.run(
        [sys.executable, "-c", ANSWER, json.dumps([*OFFERED])],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return dict(zip(OFFERED, json.loads(done.stdout), strict=True))


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


@pytest.mark.parametrize(("asked", "expected"), OFFERED.items(), ids=[line for line, _ in OFFERED])
def test_a_shell_is_offered_what_fits(answers, asked, expected):
    words, _ = answers[asked]
    assert expected <= {word.strip() for word in words}


def test_no_library_is_loaded_that_makes_a_user_wait(answers):
    for (line, _), (_, modules) in answers.items():
        assert not HEAVY & set(modules), f"{line}: {HEAVY & set(modules)}"
