# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file of rerun, read back by rerun."""

import subprocess
import sys

import pytest

rerun = pytest.importorskip("rerun", reason="the extra view (rerun-sdk) is not installed")


def test_the_file_has_road_users_modes_ellipses_truth_and_errors(scene, tmp_path):
    from mtpgo_training.view.rerun_scene import log_scene

    log_scene(scene, tmp_path / "a.rrd")
    read = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", "-v", str(tmp_path / "a.rrd")],
        capture_output=True,
        text=True,
        check=True,
    )
    told = read.stdout + read.stderr
    for part in (
        "/scene/road_users",
        "/scene/lanes",
        "/scene/predictions/modes",
        "/scene/predictions/ellipses",
        "/scene/what_happened",
        "/errors/ade",
        "/errors/final",
    ):
        assert part in told, part
