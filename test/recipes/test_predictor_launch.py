# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file under launch_testing, where ROS and this package are installed."""

import subprocess
import sys
from pathlib import Path

import pytest
from installed_ros import why_not

TEST = Path(__file__).with_name("launch_predictor.py")


@pytest.mark.timeout(600)
def test_the_predictor_gets_ready_and_ends_under_launch_testing():
    reason = why_not("launch", "launch_ros", "launch_testing")
    if reason:
        pytest.skip(reason)
    done = subprocess.run(
        [sys.executable, "-m", "launch_testing.launch_test", str(TEST)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
