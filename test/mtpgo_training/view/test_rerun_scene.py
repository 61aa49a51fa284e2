# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file of rerun, read back by rerun."""

import dataclasses
import resource
import subprocess
import sys

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError

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


def test_classes_of_a_newer_publisher_are_drawn(scene):
    from mtpgo_training.view.rerun_scene import RerunScene

    seen = scene.predictions[0].prediction
    newer = np.full(len(seen), 200, dtype=np.uint8)
    target = RerunScene("made", viewer=False)
    target.log_prediction(0.0, dataclasses.replace(seen, agent_class=newer))
    assert target.close()


def test_a_full_disk_is_one_sentence(scene, tmp_path):
    from mtpgo_training.view.rerun_scene import log_scene

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))  # 0.3 MB are to be written
    try:
        with pytest.raises(ConfigurationError, match=r"a\.rrd cannot be written: File too large"):
            log_scene(scene, tmp_path / "a.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []
