# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The versions in a report of a defect, without loading a library."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from mtpgo_core import versions
from mtpgo_core.versions import library_version, package_version, version_text

ROOT = Path(__file__).resolve().parents[2]

PROGRAMS = {
    "mtpgo": "mtpgo_training.cli",
    "predictor": "mtpgo_ros.predictor",
    "replay": "mtpgo_ros.replay",
    "record": "mtpgo_ros.record",
    "risk": "mtpgo_ros.risk",
    "load_generator": "mtpgo_ros.load_generator",
}


def test_the_text_names_package_libraries_and_shipped_models():
    text = version_text("predictor")
    first, *lines = text.splitlines()
    assert first == f"predictor {package_version()} (mtpgo_ros)"
    rows = dict(line.strip().split("  ", 1) for line in lines)
    rows = {name: value.strip() for name, value in rows.items()}
    assert rows["torch"] == torch.__version__.partition("+")[0] or rows["torch"] in (
        torch.__version__
    )
    assert rows["Python"].startswith(".".join(map(str, sys.version_info[:3])))
    model = (ROOT / "resource" / "weights" / "default.pt").read_bytes()
    assert rows["model default"] == f"sha256 {hashlib.sha256(model).hexdigest()}"


def test_what_is_missing_is_said(monkeypatch):
    assert library_version("no-such-distribution") == "not installed"
    monkeypatch.setattr(versions, "LIBRARIES", ("no-such-distribution",))
    monkeypatch.setattr(versions, "find_resource", _nothing)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    text = version_text("replay")
    assert "no-such-distribution  not installed" in text
    assert "(ROS 2 jazzy is sourced)" in text
    assert "model " not in text


def _nothing(*parts):
    raise versions.ConfigurationError("nothing is installed")


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_executable_answers_without_ros_and_torch(program):
    """A broken installation is what such a report is mostly about."""
    code = (
        "import sys\n"
        "sys.modules['torch'] = sys.modules['rclpy'] = None\n"
        f"from {PROGRAMS[program]} import main\n"
        "try:\n"
        "    status = main(['--version'])\n"
        "except SystemExit as ended:\n"
        "    status = ended.code\n"
        "sys.exit(status)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{program} {package_version()} (mtpgo_ros)\n")


def test_the_version_is_not_taken_from_arguments_of_ros():
    from mtpgo_ros.runtime.executable import ArgumentParser, answered

    parser = ArgumentParser(prog="x")
    assert not answered("x", ["--ros-args", "-p", "--version"], lambda: parser)
    assert "--version" in parser.format_help()
