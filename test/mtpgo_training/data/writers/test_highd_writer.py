# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in highD's layout: read back, and with derived columns worked out by hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from road_scene import SCENE

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.highd_writer import write_highd


def test_highd_columns_by_hand(tmp_path: Path) -> None:
    tracks, meta, general = (pd.read_csv(p) for p in write_highd(SCENE, tmp_path, compress=False))
    first = tracks[tracks["frame"] == 1].set_index("id")
    assert tracks["id"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4]
    one = first.loc[1]
    assert (one.x, one.y, one.width, one.height) == (98.0, 25.0, 4.0, 2.0)
    assert (one.xVelocity, first.loc[4].xVelocity, first.loc[4].yVelocity) == (20.0, -25.0, -5.0)
    # Gap 130 - 100 - 4 = 26 m; 26 / 20 s; 26 / (20 - 15) s.
    assert (one.dhw, one.thw, one.ttc, one.precedingXVelocity) == (26.0, 1.3, 5.2, 15.0)
    assert (one.precedingId, one.followingId, one.leftAlongsideId) == (2, 0, 3)
    assert (first.loc[2].followingId, first.loc[2].leftFollowingId) == (1, 3)
    assert (first.loc[3].rightPrecedingId, first.loc[3].rightAlongsideId) == (2, 1)
    assert (one.frontSightDistance, one.backSightDistance) == (318.0, 98.0)
    assert (first.loc[4].frontSightDistance, first.loc[4].backSightDistance) == (298.0, 118.0)
    assert first["laneId"].tolist() == [6, 6, 5, 3]
    assert tracks[(tracks["id"] == 4) & (tracks["frame"] == 2)]["laneId"].item() == 2
    assert meta["drivingDirection"].tolist() == [2, 2, 2, 1]
    assert meta["numLaneChanges"].tolist() == [0, 0, 0, 1]
    # Frame 2: gap 130.6 - 100.8 - 4 = 25.8 m.
    assert meta["minDHW"].tolist() == [25.8, -1, -1, -1]
    assert meta["minTTC"].tolist() == [5.16, -1, -1, -1]
    assert general["upperLaneMarkings"].item() == "8.00;12.00;16.00"
    assert general["lowerLaneMarkings"].item() == "20.00;24.00;28.00"


@pytest.mark.parametrize("compress", [False, True])
def test_highd_round_trip(tmp_path: Path, compress: bool) -> None:
    write_highd(SCENE, tmp_path, compress=compress)
    (back,) = load_recordings(tmp_path, "highd")
    for name in ("frame", "track", "track_id", "agent_class"):
        np.testing.assert_array_equal(getattr(back, name), getattr(SCENE, name))
    for name in ("position", "velocity", "acceleration", "size"):
        np.testing.assert_allclose(getattr(back, name), getattr(SCENE, name), atol=1e-9)
    np.testing.assert_allclose(back.lanes[0][:, 1], SCENE.lanes[0][:, 1])
    assert np.sign(np.diff(back.lanes[0][:, 0])) == -1
    assert len(back.lanes) == 6


def test_highd_cannot_carry_everything(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"0 lane markings to the left and 0 to the right"):
        write_highd(dataclasses.replace(SCENE, lanes=()), tmp_path)
    curved = (np.array([[0.0, 0.0], [9.0, 1.0]]),)
    with pytest.raises(RecordingError, match=r"curved or tilted lane marking"):
        write_highd(dataclasses.replace(SCENE, lanes=curved), tmp_path)
    with pytest.raises(RecordingError, match=r"number below 1"):
        write_highd(dataclasses.replace(SCENE, track_id=np.arange(4)), tmp_path)
    unknown = np.full((4, 2), np.nan)
    with pytest.raises(RecordingError, match=r"without a size"):
        write_highd(dataclasses.replace(SCENE, size=unknown), tmp_path)
    assert list(tmp_path.iterdir()) == []
