# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file under launch_testing, where ROS and this package are installed."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

TEST = Path(__file__).with_name("launch_predictor.py")


def why_not():
    """Return why launch_testing cannot start the installed predictor, empty if it can."""
    for package in ("launch", "launch_ros", "launch_testing"):
        if not importlib.util.find_spec(package):
            return f"{package} is not installed: it comes with ROS, not by pip"
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    marker = Path("share/ament_index/resource_index/packages/mtpgo_ros")
    if not any(prefix and (Path(prefix) / marker).is_file() for prefix in prefixes):
        return "mtpgo_ros is not in AMENT_PREFIX_PATH: build it and source the workspace"
    return ""


@pytest.mark.timeout(600)
def test_the_predictor_gets_ready_and_ends_under_launch_testing():
    reason = why_not()
    if reason:
        pytest.skip(reason)
    done = subprocess.run(
        [sys.executable, "-m", "launch_testing.launch_test", str(TEST)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
