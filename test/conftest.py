# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Environment variables of all tests, set before any module reads them, and what is collected."""

import os
import sys
import zlib
from pathlib import Path

TEST = Path(__file__).resolve().parent
sys.path[:0] = [str(TEST), str(TEST / "selection")]

from needed_packages import is_installed, left_out, missing_for  # noqa: E402  found by that path

# By default rclpy does not check the types of message fields and publishes wrong values.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
# Separate simultaneous test runs on one machine, and always the processes of one run (pytest -n).
# Domains up to 101 do not use the ports that Linux assigns to clients.
PROCESS = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
RUN = zlib.crc32(os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid())).encode())
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(1 + (2 * RUN + PROCESS) % 100)
os.environ.pop("RMW_IMPLEMENTATION", None)
# One thread per process, as on the robot: reproducible, and no overload on a busy machine.
# MTPGO_TEST_THREADS=2 gives the numerical tests two; their fixtures read OMP_NUM_THREADS.
os.environ["OMP_NUM_THREADS"] = os.environ.get("MTPGO_TEST_THREADS", "1")
os.environ["MPLBACKEND"] = "Agg"


def pytest_ignore_collect(collection_path):
    """Leave out the tests whose packages are not installed, before anything imports them."""
    if not collection_path.is_relative_to(TEST):
        return None
    name = collection_path.relative_to(TEST).as_posix()
    return True if missing_for(name, is_installed) else None


def pytest_report_header():
    return left_out(is_installed)


def pytest_terminal_summary(terminalreporter):
    for line in left_out(is_installed):
        terminalreporter.line(line, yellow=True)
