# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The file of rerun, read back by rerun."""

import dataclasses
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


def test_classes_of_a_newer_publisher_are_drawn(scene, tmp_path):
    from mtpgo_training.view.rerun_scene import RerunScene

    seen = scene.predictions[0].prediction
    newer = np.full(len(seen), 200, dtype=np.uint8)
    target = RerunScene("made", tmp_path / "a.rrd")
    target.log_prediction(0.0, dataclasses.replace(seen, agent_class=newer))
    target.close()
    assert (tmp_path / "a.rrd").stat().st_size > 0


def test_a_disk_that_is_full_is_one_error(tmp_path, monkeypatch):
    from mtpgo_training.view import rerun_scene

    def full(self, **_):
        raise RuntimeError("File-writer thread shut down prematurely")

    target = rerun_scene.RerunScene("made", tmp_path / "a.rrd")
    monkeypatch.setattr(rerun_scene.rr.RecordingStream, "flush", full)
    with pytest.raises(ConfigurationError, match="rerun could not write"):
        target.close()
