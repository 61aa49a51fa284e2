# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A short run of the simulated motorway, and the recording that was made with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from simulated_traffic import check_consistent, needs_sumo

from mtpgo_core.resources import find_resource
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.highd_writer import write_highd
from mtpgo_training.simulate.highway import HighwayConfig, simulate_highway


@needs_sumo
def test_highway_is_a_highd_recording(tmp_path: Path) -> None:
    config = HighwayConfig(
        seconds=5.0, seed=3, traffic="dense", lanes=2, truck_share=0.2, warm_up_s=40.0
    )
    recording = simulate_highway(config)
    assert (recording.frame.min(), recording.frame.max()) == (1, 125)
    assert len(recording.track_id) >= 5
    left = np.cos(recording.yaw) < 0
    assert left.any()
    assert not left.all()
    # Right-hand traffic: the upper carriageway drives left, all vehicles between the outer lines.
    lines = [float(line[0, 1]) for line in recording.lanes]
    for upper, own in ((True, lines[:3]), (False, lines[3:])):
        y = recording.position[left == upper, 1]
        assert min(own) < y.min() < y.max() < max(own)
    half = recording.size[recording.track, 0] / 2
    assert (recording.position[:, 0] - half >= 0).all()
    assert (recording.position[:, 0] + half <= 420).all()
    check_consistent(recording, sideways_mps=1.0)
    write_highd(recording, tmp_path)
    (back,) = load_recordings(tmp_path, "highd")
    np.testing.assert_allclose(back.position, recording.position, atol=1.1e-3)
    again = simulate_highway(config)
    np.testing.assert_array_equal(again.position, recording.position)


def test_the_shipped_recording_is_dense_traffic_with_lane_changes() -> None:
    (recording,) = load_recordings(find_resource("recordings", "highway"), "highd")
    assert recording.frame_rate == 25.0
    assert 25.0 <= recording.duration_s <= 40.0
    at_once = np.bincount(recording.frame)[recording.frame.min() :]
    assert at_once.mean() >= 25
    assert at_once.max() <= 48
    left = np.cos(recording.yaw) < 0
    assert 0.2 < left.mean() < 0.8
    forward = recording.acceleration[:, 0] * np.where(left, -1, 1)
    assert forward.min() < -2.0
    changed = 0
    for index in range(len(recording.track_id)):
        y = recording.position[recording.track == index, 1]
        changed += int(np.ptp(y) > 2.5)
    assert changed >= 5
    assert len(recording.lanes) >= 6
