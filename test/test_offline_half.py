# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The offline packages work without ROS: rclpy and the message packages are hidden."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

HIDE_ROS = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top == "rclpy" or top.endswith(("_msgs", "_interfaces")):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden())
sys.path.insert(0, sys.argv[1])
"""

IMPORT_ALL = """
import importlib, pkgutil
for package in ("models", "mtpgo_core", "msg_adapters", "mtpgo_training"):
    module = importlib.import_module(package)
    for found in pkgutil.walk_packages(module.__path__, package + "."):
        importlib.import_module(found.name)
assert "rclpy" not in sys.modules
"""

CONVERT = """
from mtpgo_training.cli import main
sys.exit(main(["convert", "ind", sys.argv[2], "-o", sys.argv[3]]))
"""

TABLES = {
    "tracksMeta": (
        "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n"
        "1,0,0,1,2,1.9,4.5,car\n"
    ),
    "recordingMeta": "recordingId,locationId,frameRate,speedLimit,duration\n1,1,10,13.9,0.1\n",
    "tracks": (
        "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,"
        "yVelocity,xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,"
        "latAcceleration\n"
        "1,0,0,0,1.0,2.0,0.0,1.9,4.5,10.0,0.0,0.0,0.0,10.0,0.0,0.0,0.0\n"
        "1,0,1,1,2.0,2.0,0.0,1.9,4.5,10.0,0.0,0.0,0.0,10.0,0.0,0.0,0.0\n"
    ),
}


def run(code: str, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", HIDE_ROS + code, str(ROOT), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


def test_every_module_imports():
    done = run(IMPORT_ALL)
    assert done.returncode == 0, done.stderr


def test_a_recording_is_converted_into_a_bag(tmp_path):
    for name, text in TABLES.items():
        (tmp_path / f"01_{name}.csv").write_text(text)
    done = run(CONVERT, str(tmp_path), str(tmp_path / "out.mcap"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.mcap").stat().st_size > 0


def test_rclpy_is_hidden():
    done = run("import rclpy")
    assert "No module named 'rclpy'" in done.stderr
