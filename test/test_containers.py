# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Dockerfile and development container, read as text: they agree with setup.py and the tree."""

import fnmatch
import json
import os
import re
import shlex
from pathlib import Path

import declared
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
CPU_INDEX = "https://download.pytorch.org/whl/cpu"


def instructions() -> list[tuple[str, str, str]]:
    """Return stage, instruction and arguments of each instruction of the Dockerfile."""
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    text = "\n".join(line for line in lines if not line.lstrip().startswith("#"))
    found, stage = [], ""
    for line in text.replace("\\\n", " ").splitlines():
        if not line.strip():
            continue
        word, _, rest = line.strip().partition(" ")
        rest = " ".join(rest.split())
        if word == "FROM":
            stage = rest.rpartition(" AS ")[2]
        found.append((stage, word, rest))
    return found


INSTRUCTIONS = instructions()
STAGES = {stage: rest.split()[0] for stage, word, rest in INSTRUCTIONS if word == "FROM"}


def commands(tool: str) -> list[tuple[str, list[str]]]:
    """Return stage and words of each command of the RUN instructions that starts with ``tool``."""
    return [
        (stage, words)
        for stage, word, rest in INSTRUCTIONS
        if word == "RUN"
        for words in (shlex.split(part) for part in rest.split(" && "))
        if words[: len(tool.split())] == tool.split()
    ]


def ignored(path: str) -> bool:
    """Return whether .dockerignore leaves out a path: it, or a folder that it is in."""
    patterns = [
        line
        for line in (ROOT / ".dockerignore").read_text().splitlines()
        if line and not line.startswith("#")
    ]
    parts = Path(path).parts
    above = ["/".join(parts[: count + 1]) for count in range(len(parts))]
    return any(
        fnmatch.fnmatch(part, pattern)
        or (pattern.startswith("**/") and fnmatch.fnmatch(Path(part).name, pattern[3:]))
        for part in above
        for pattern in patterns
    )


def test_there_is_an_image_on_jazzy_and_one_on_slim_python():
    assert STAGES["jazzy"].startswith("ros:jazzy")
    assert re.fullmatch(r"python:3\.1[12]-slim", STAGES["slim"])
    assert not any(base.endswith(":latest") or ":" not in base for base in STAGES.values())


def test_pip_installs_what_setup_py_declares():
    ranges = {str(one): one for one in declared.requirements()}
    names = set(declared.extras())
    installed = []
    for stage, words in commands("pip install"):
        options = {"--index-url", "-r"}
        rest, given = iter(words[2:]), []
        for word in rest:
            if word in options:
                given.append((word, next(rest)))
            else:
                given.append(("", word))
        values = [value for option, value in given if option == ""]
        for value in values:
            extra = re.fullmatch(r"\.\[([\w,]+)\]", value)
            if extra:
                assert set(extra[1].split(",")) <= names
            else:
                assert str(declared.Requirement(value)) in ranges, value
        for option, value in given:
            if option == "--index-url":
                assert (value, values) == (CPU_INDEX, [v for v in values if v.startswith("torch")])
        installed.append((stage, given))
    for stage in ("jazzy", "slim"):
        first, second = [given for place, given in installed if place == stage]
        assert ("--index-url", CPU_INDEX) in first, "PyTorch's CPU build comes first"
        assert ("--index-url", CPU_INDEX) not in second
    assert ("jazzy", [("-r", "/tmp/mtpgo_ros/robot.txt")]) in installed
    assert ("slim", [("", ".[ros]")]) in installed


def test_a_robot_gets_the_packages_of_setup_py_except_numpy():
    robot = {str(one) for one in declared.listed(ROOT / "requirements" / "robot.txt")}
    # rclpy from apt is built against the system's numpy.
    assert robot == {str(one) for one in declared.requirements() if one.name != "numpy"}


def test_the_readme_prints_the_command_for_pytorch_without_cuda():
    (torch,) = [one for one in declared.requirements() if one.name == "torch"]
    line = next(
        line for line in (ROOT / "README.md").read_text().splitlines() if CPU_INDEX in line
    )
    words = shlex.split(line, comments=True)
    assert words[:2] == ["pip", "install"]
    assert declared.Requirement(words[-1]) == torch


def test_apt_leaves_nothing_behind_and_takes_no_recommendations():
    stages = [stage for stage, _ in commands("apt-get install")]
    assert stages == ["jazzy", "development"]
    for _, words in commands("apt-get install"):
        assert {"-y", "--no-install-recommends"} <= set(words)
    for _, word, rest in INSTRUCTIONS:
        if word == "RUN" and "apt-get install" in rest:
            assert rest.startswith("apt-get update && ")
            assert "rm -rf /var/lib/apt/lists/*" in rest
    # package.xml names the rest, and rosdep reads it.
    (words,) = [words for _, words in commands("rosdep install")]
    assert words[words.index("--from-paths") + 1] == "/tmp/mtpgo_ros"
    by_pip = yaml.safe_load((ROOT / "requirements" / "rosdep.yaml").read_text())
    assert set(words[words.index("--skip-keys") + 1].split()) == set(by_pip)


def test_what_is_copied_exists_and_is_not_ignored():
    for _, word, rest in INSTRUCTIONS:
        if word == "COPY":
            source = rest.split()[0]
            assert (ROOT / source).exists(), source
            assert source == "." or not ignored(source), source
    needed = ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "README.md", "launch")
    for name in (*declared.packages(), *needed, "config/training", "resource/weights/default.pt"):
        assert (ROOT / name).exists()
        assert not ignored(name), name
    for name in (".git", ".venv", ".venv-3.12", "models/__pycache__", "test/conftest.py"):
        assert ignored(name), name


@pytest.mark.parametrize("stage", ["jazzy", "slim", "development"])
def test_no_image_runs_as_root_and_each_starts_something(stage):
    own = [(word, rest) for place, word, rest in INSTRUCTIONS if place == stage]
    users = [rest for word, rest in own if word == "USER"]
    assert users
    assert users[-1] not in ("root", "0")
    (command,) = [json.loads(rest) for word, rest in own if word == "CMD"]
    assert Path(command[-1]).name in ("predictor", "bash")


def test_the_entry_point_sources_ros_and_the_workspace_and_becomes_the_command():
    path = ROOT / "docker" / "entrypoint.sh"
    assert os.access(path, os.X_OK)
    lines = path.read_text().splitlines()
    assert lines[0] == "#!/bin/bash"
    assert [line for line in lines if line and not line.startswith("#")] == [
        "set -e",
        "source /opt/ros/jazzy/setup.bash",
        "source /ws/install/setup.bash",
        'exec "$@"',
    ]


def test_the_development_container_is_built_from_the_dockerfile():
    folder = ROOT / ".devcontainer"
    content = json.loads((folder / "devcontainer.json").read_text())
    build = content["build"]
    assert (folder / build["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (folder / build["context"]).resolve() == ROOT
    assert build["target"] in STAGES
    (added,) = [words for stage, words in commands("useradd") if stage == "development"]
    assert added[-1] == content["remoteUser"]
    assert ("development", "USER", added[added.index("--uid") + 1]) in INSTRUCTIONS
    tool, target = content["postCreateCommand"].split()
    assert tool == "make"
    assert re.search(rf"(?m)^{target}:", (ROOT / "Makefile").read_text())


def test_the_images_start_the_node_itself_and_stop_it_by_a_signal_that_launch_obeys():
    """As process 1, `ros2 run` passes no signal on and `ros2 launch` obeys SIGINT only."""
    last = {(stage, word): rest for stage, word, rest in INSTRUCTIONS}
    for stage in ("jazzy", "slim"):
        (command,) = json.loads(last[stage, "CMD"])
        assert Path(command).name == "predictor"
    assert json.loads(last["jazzy", "CMD"]) == ["/ws/install/mtpgo_ros/lib/mtpgo_ros/predictor"]
    assert last["jazzy", "STOPSIGNAL"] == "SIGINT"
