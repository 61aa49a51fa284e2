# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checks of commands that pages show, against what reads them: parsers, launch files, make.

Each check returns what is wrong in a sentence, nothing if nothing is.
"""

import argparse
import contextlib
import dataclasses
import functools
import importlib.util
import io
import re
import subprocess
from collections.abc import Callable, Sequence
from xml.etree import ElementTree

import declared
import launch_stub
import pytest
import yaml
from page_blocks import PLACEHOLDERS, ROOT

from docs_site.code_pages import NODES
from docs_site.command_parsers import all_parsers
from mtpgo_core.errors import MtpgoError
from mtpgo_core.options import check_options
from mtpgo_ros.parameters.parameter_change import replaced
from mtpgo_training.cli import COMMANDS, build_parser

SHELL = {".", "cd", "echo", "exec", "exit", "export", "kill", "set", "source", "wait"}

OTHERS = {
    "apt": "Debian",
    "apt-get": "Debian",
    "cat": "coreutils",
    "chromium": "Debian",
    "cmake": "CMake",
    "curl": "curl",
    "docker": "Docker",
    "g++": "GCC",
    "git": "git",
    "journalctl": "systemd",
    "mkdir": "coreutils",
    "rosdep": "ROS",
    "rviz2": "ROS",
    "sha256sum": "coreutils",
    "sudo": "sudo",
    "systemctl": "systemd",
    "tensorboard": "TensorBoard",
}
"""Programs of others that pages show: their arguments are not checked."""

ROS_VERBS = {
    "action": "",
    "bag": "record play info convert",
    "control": "",
    "interface": "show list",
    "lifecycle": "set get nodes list",
    "node": "list info",
    "param": "set get list dump load",
    "run": "",
    "security": "create_keystore create_enclave create_permission",
    "service": "call list type",
    "topic": "echo hz list pub info type bw",
}
"""Commands of ``ros2`` and their verbs; launch is checked against the launch file."""

NODE_ARGUMENTS = {"use_sim_time"}
REMAPPED = re.compile(r"~?/?[\w/]+|__(ns|node|name)")


def problem_with(words: Sequence[str]) -> str:
    """Return what is wrong with a command, "" if nothing is."""
    name = words[0].rpartition("/")[2] if words[0].startswith(".venv") else words[0]
    if name in SHELL | OTHERS.keys():
        return ""
    checks: dict[str, Callable[[Sequence[str]], str]] = {
        "colcon": _colcon,
        "make": _make,
        "mtpgo": _mtpgo,
        "pip": _pip,
        "python": _python,
        "python3": _python,
        "python3.12": _python,
        "ros2": _ros2,
    }
    if name in checks:
        return _missing_files(words) or checks[name](words[1:])
    if name in declared.executables():
        return _node(name, words[1:])
    return f"{name} is no command of this project, nor one of {', '.join(sorted(OTHERS))}"


def inline_problem(code: str) -> str:
    """Return what is wrong with a command in a sentence, which may be given in part."""
    words = code.split()
    if words[0] == "make" and len(words) > 1:
        return "" if words[1] in make_targets() or "=" in words[1] else f"no target {words[1]}"
    if words[0] != "mtpgo" or len(words) < 2 or not re.fullmatch(r"[a-z]+", words[1]):
        return ""
    if words[1] not in COMMANDS:
        return f"mtpgo has no command {words[1]}"
    return _options_exist([word.strip("[].,") for word in words[1:]])


@functools.cache
def make_targets() -> set[str]:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z][a-z-]*):(?!=)", text, re.MULTILINE))


@functools.cache
def parsers() -> dict[str, argparse.ArgumentParser]:
    return {name: parser for name, _, parser in all_parsers()}


def _mtpgo(words: Sequence[str]) -> str:
    if not words or words[0] not in COMMANDS:
        known = words and words[0] in ("--help", "--version")
        return "" if known else f"mtpgo has no command {' '.join(words[:1])}"
    if "..." in words or any(word[0] in "[|" for word in words if word):  # a synopsis
        return _options_exist([word.strip("[]|") for word in words])
    given = [PLACEHOLDERS.get(word, word) for word in words]
    return _parsed(build_parser(given[0]), given)


def _options_exist(words: Sequence[str]) -> str:
    """Check the options of a command that is given in part."""
    name = f"mtpgo {words[0]}"
    while len(words) > 1 and f"{name} {words[1]}" in parsers():
        words = words[1:]
        name += f" {words[0]}"
    inner = [parser for other, parser in parsers().items() if other.startswith(f"{name} ")]
    known = {
        option for parser in (parsers()[name], *inner) for option in parser._option_string_actions
    }
    for word in words[1:]:
        option = word.partition("=")[0]
        if re.fullmatch(r"--?[a-z][\w-]*", option) and option not in known:
            return f"{name} has no option {option}"
    return ""


def _parsed(parser: argparse.ArgumentParser, words: Sequence[str]) -> str:
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            parser.parse_args(list(words))
    except SystemExit as ended:
        return said.getvalue().strip().rpartition("\n")[2] if ended.code else ""
    except MtpgoError as error:
        return str(error)
    return ""


def _node(name: str, words: Sequence[str]) -> str:
    own, _, ros = _split(words, "--ros-args")
    module = importlib.import_module(declared.executables()[name])
    if hasattr(module, "_parser"):
        said = _parsed(module._parser(), own)
    else:
        said = "" if set(own) <= {"--end-with-parent", "--help", "--version"} else f"{own}"
    return said or _ros_arguments(name, ros)


def _ros_arguments(name: str, words: Sequence[str]) -> str:
    values = iter(words)
    for word in values:
        if word in ("-p", "--param"):
            said = _parameter(name, next(values, ""))
        elif word in ("-r", "--remap"):
            old, _, new = next(values, "").partition(":=")
            said = "" if new and REMAPPED.fullmatch(old) else f"-r {old} is no remapping"
        elif word in ("--params-file", "--enclave", "--log-level"):
            said = "" if next(values, "") else f"{word} has no value"
        else:
            said = f"{word} is no argument of ROS"
        if said:
            return said
    return ""


def _parameter(name: str, text: str) -> str:
    parameter, _, value = text.partition(":=")
    if name not in NODES or parameter in NODE_ARGUMENTS:
        return ""
    fields = {field.name: field for field in dataclasses.fields(NODES[name])}
    if parameter not in fields:
        return f"{name} has no parameter {parameter}"
    wanted = type(fields[parameter].default)
    given = yaml.safe_load(value)
    with contextlib.suppress(TypeError, ValueError):
        given = wanted([given] if wanted is tuple and isinstance(given, str) else given)
    try:
        check_options(replaced(NODES[name](), {parameter: given}), "parameter ")
    except MtpgoError as error:
        return str(error)
    return ""


def _ros2(words: Sequence[str]) -> str:
    verb = words[0]
    if verb == "launch":
        return launch_problem(words[1:])
    if verb == "run":
        if words[1] != "mtpgo_ros":
            return ""
        if words[2] not in declared.executables():
            return f"mtpgo_ros has no executable {words[2]}"
        return _node(words[2], words[3:])
    if verb not in ROS_VERBS:
        return f"ros2 has no command {verb}"
    allowed = ROS_VERBS[verb].split()
    return "" if not allowed or words[1] in allowed else f"ros2 {verb} has no verb {words[1]}"


def launch_problem(words: Sequence[str]) -> str:
    """Return what is wrong with the arguments of ``ros2 launch``."""
    if words[0] != "mtpgo_ros":
        return ""
    path = ROOT / "launch" / words[1]
    if not path.is_file():
        return f"there is no launch file {words[1]}"
    known = launch_arguments(words[1])
    for word in words[2:]:
        argument, assigned, _ = word.partition(":=")
        if not assigned or argument not in known:
            return (
                f"{words[1]} has no argument {word}, expected some of {', '.join(sorted(known))}"
            )
    return ""


@functools.cache
def launch_arguments(name: str) -> frozenset[str]:
    """Return the arguments that a launch file declares, which runs without ROS' launch."""
    path = ROOT / "launch" / name
    if path.suffix == ".xml":
        root = ElementTree.parse(path).getroot()
        return frozenset(arg.get("name", "") for arg in root.findall("arg"))
    with pytest.MonkeyPatch.context() as patch:
        entities = launch_stub.load(path, patch).generate_launch_description().entities
    return frozenset(
        one.name for one in entities if isinstance(one, launch_stub.DeclareLaunchArgument)
    )


def _make(words: Sequence[str]) -> str:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    for word in words:
        variable, assigned, _ = word.partition("=")
        if assigned and not re.search(rf"\$\({variable}\)|^{variable} \?=", text, re.MULTILINE):
            return f"the Makefile has no variable {variable}"
        if not assigned and word[0] != "-" and word not in make_targets():
            return f"the Makefile has no target {word}"
    done = subprocess.run(
        ["make", "--dry-run", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return "" if done.returncode == 0 else done.stderr.strip()


def _pip(words: Sequence[str]) -> str:
    if words[0] != "install":
        return ""
    for number, word in enumerate(words):
        found = re.fullmatch(r"(?:\.|mtpgo_ros|\S*\.whl)\[([\w,-]+)\]", word)
        if found and not set(found[1].split(",")) <= declared.extras().keys():
            return f"{word} names an extra that is not in setup.py"
        if word == "-r":
            path = words[number + 1].rpartition("mtpgo_ros/")[2]
            if not (ROOT / path).is_file():
                return f"there is no file {path}"
    return ""


def _python(words: Sequence[str]) -> str:
    if words[0] == "-m":
        there = importlib.util.find_spec(words[1].partition(".")[0]) is not None
        return "" if there or words[1] == "build" else f"there is no module {words[1]}"
    if words[0] == "-c" or words[0].startswith("-"):
        return ""
    return "" if (ROOT / words[0]).is_file() else f"there is no file {words[0]}"


def _colcon(words: Sequence[str]) -> str:
    known = {"build", "info", "list", "test", "test-result"}
    return "" if words[0] in known else f"colcon has no verb {words[0]}"


def _missing_files(words: Sequence[str]) -> str:
    """Return the first word that names a file of the repository which is not there."""
    folder = re.compile(r"(config|launch|resource|benchmarks|requirements|test)/[\w./-]+$")
    for word in words:
        if folder.match(word) and not (ROOT / word).exists():
            return f"there is no {word}"
    return ""


def _split(words: Sequence[str], at: str) -> tuple[list[str], str, list[str]]:
    place = words.index(at) if at in words else len(words)
    return list(words[:place]), at, list(words[place + 1 :])
