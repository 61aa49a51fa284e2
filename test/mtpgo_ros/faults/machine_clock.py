# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sets the machine's clock for chosen processes, and a tracker that stamps with it.

The real clock is not touched: ``machine_clock.c`` is loaded into the processes.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_helpers import ROOT, end

SOURCE = Path(__file__).with_name("machine_clock.c")


def compiled(folder: Path) -> Path:
    """Return the library that is loaded into processes; skip the test without a compiler."""
    compiler = shutil.which("gcc")
    if sys.platform != "linux" or compiler is None:
        pytest.skip("gcc on Linux is needed to set the clock of a process, and is not there")
    library = folder / "machine_clock.so"
    command = [compiler, "-O1", "-shared", "-fPIC", "-o", library, SOURCE, "-ldl"]
    subprocess.run(command, check=True)
    return library


class MachineClock:
    """The clock of the processes that are started within :meth:`loaded`.

    Args:
        library: of :func:`compiled`.
        file: what it reads; made here.
    """

    def __init__(self, library: Path, file: Path) -> None:
        self._library, self._path = library, file
        file.write_bytes(bytes(8))
        with file.open("r+b") as opened:
            self._offset = mmap.mmap(opened.fileno(), 8)
        self.offset_s = 0.0

    def set_by(self, seconds: float) -> None:
        """Set the clock back or forward, from where it is."""
        self.offset_s += seconds
        self._offset[:] = struct.pack("=q", round(self.offset_s * 1e9))

    @contextlib.contextmanager
    def loaded(self) -> Iterator[None]:
        """Load the clock into processes that are started within the block."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("LD_PRELOAD", str(self._library), prepend=":")
            patch.setenv("MTPGO_TEST_CLOCK", str(self._path))
            yield


TRACKER = """
import sys, time, dataclasses
import rclpy
from rclpy.qos import QoSProfile
from ros_helpers import message_of, traffic
from sensor_msgs.msg import PointCloud2
rclpy.init()
node = rclpy.create_node("tracker", namespace=sys.argv[1])
publisher = node.create_publisher(PointCloud2, "objects", QoSProfile(depth=5))
begin_s = float(sys.argv[2])
while rclpy.ok():
    states = traffic(time.monotonic() - begin_s)
    publisher.publish(message_of(dataclasses.replace(states, stamp_ns=time.time_ns())))
    time.sleep(0.1)
"""
"""Publishes the cars of ``traffic`` at 10 Hz; they move by the monotonic clock."""

_BEGIN_S = time.monotonic()
"""When the cars begin to move (s), for all trackers: they do not jump when another one starts."""


@contextlib.contextmanager
def tracker(namespace: str, clock: MachineClock) -> Iterator[None]:
    """Run a tracker with a clock within the block."""
    path = os.pathsep.join(str(ROOT / part) for part in ("", "test", "test/mtpgo_ros"))
    with clock.loaded():
        process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", TRACKER, namespace, str(_BEGIN_S)],
            env={**os.environ, "PYTHONPATH": path},
        )
    try:
        yield
    finally:
        end(process)
