# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is written is read back, and the derived columns are those worked out by hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.highd_neighbours import NEIGHBOURS, neighbours
from mtpgo_training.data.writers.highd_writer import write_highd
from mtpgo_training.data.writers.ind_writer import write_ind

LINES = (-8.0, -12.0, -16.0), (-20.0, -24.0, -28.0)


def road(rows: list[tuple[int, int, float, float, float, float]]) -> Recording:
    """Cars of 4 m x 2 m from (frame, id, x, y, vx, vy)."""
    table = np.array(rows)
    track_id, track = np.unique(table[:, 1].astype(int), return_inverse=True)
    return Recording(
        name="03",
        layout="highd",
        location="1",
        frame_rate=25.0,
        frame=table[:, 0].astype(np.int64),
        track=track.astype(np.int64),
        position=table[:, 2:4],
        velocity=table[:, 4:6],
        acceleration=np.zeros((len(table), 2)),
        yaw=np.where(table[:, 4] < 0, np.pi, 0.0) + 0.0 * table[:, 0],
        track_id=track_id,
        agent_class=np.full(len(track_id), AgentClass.CAR, dtype=np.uint8),
        size=np.tile([4.0, 2.0], (len(track_id), 1)),
        lanes=tuple(
            np.array([[start, y], [end, y]])
            for side, (start, end) in zip(LINES, ((420.0, 0.0), (0.0, 420.0)), strict=True)
            for y in side
        ),
    )


# Lower carriageway, frame 1: 1 and 2 in the right lane (2 ahead), 3 alongside 1 in the left one.
# Upper: 4 alone in its left lane; it changes to the right lane in frame 2.
SCENE = road(
    [
        (1, 1, 100.0, -26.0, 20.0, 0.0),
        (1, 2, 130.0, -26.0, 15.0, 0.0),
        (1, 3, 102.0, -22.0, 30.0, 0.0),
        (1, 4, 300.0, -14.0, -25.0, 5.0),
        (2, 1, 100.8, -26.0, 20.0, 0.0),
        (2, 2, 130.6, -26.0, 15.0, 0.0),
        (2, 3, 103.2, -22.0, 30.0, 0.0),
        (2, 4, 299.0, -11.9, -25.0, 5.0),
    ]
)


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


def test_packed_files_are_the_same_every_time(tmp_path: Path) -> None:
    (first, *_), (second, *_) = (
        write_highd(SCENE, tmp_path / "a"),
        write_highd(SCENE, tmp_path / "b"),
    )
    assert first.read_bytes() == second.read_bytes()
    # The name inside is the file's own, not that of a temporary one, which no two runs share.
    named = first.read_bytes()[10:].split(b"\0", 1)[0]
    assert named == b"03_tracks.csv"


def test_ind_round_trip_and_turned_vectors(tmp_path: Path) -> None:
    yaw = np.full(len(SCENE), np.pi / 2)
    scene = dataclasses.replace(
        SCENE,
        yaw=yaw,
        agent_class=np.array(
            [AgentClass.CAR, AgentClass.TRUCK, AgentClass.BICYCLE, AgentClass.PEDESTRIAN],
            dtype=np.uint8,
        ),
        size=np.array([[4.0, 2.0], [12.0, 2.5], [1.8, 0.6], [np.nan, np.nan]]),
    )
    path, *_ = write_ind(scene, tmp_path, compress=False)
    tracks = pd.read_csv(path)
    last = tracks.iloc[-1]
    # Velocity (-25, 5) seen along +y: 5 ahead, 25 to the left.
    assert (last.lonVelocity, last.latVelocity, last.heading) == (5.0, 25.0, 90.0)
    assert (last.width, last.length, last.trackLifetime) == (0.0, 0.0, 1)
    (back,) = load_recordings(tmp_path, "ind")
    np.testing.assert_allclose(back.position, scene.position)
    np.testing.assert_allclose(back.velocity, scene.velocity)
    np.testing.assert_allclose(back.yaw, scene.yaw, atol=1e-6)
    np.testing.assert_array_equal(back.size, scene.size)
    np.testing.assert_array_equal(back.agent_class, scene.agent_class)


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


def test_unwritable_directory_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"file/x cannot be written to"):
        write_highd(SCENE, tmp_path / "file" / "x")


def test_neighbours_against_the_obvious_search() -> None:
    generator = np.random.default_rng(5)
    along, length = generator.uniform(0, 200, 30), generator.uniform(3, 18, 30)
    lane = generator.integers(0, 3, 30)
    found = neighbours(along, length, lane)
    for i in range(30):
        for column, name in enumerate(NEIGHBOURS):
            want = lane[i] + (1 if name.startswith("left") else -1 if "right" in name else 0)
            best, nearest = -1, np.inf
            for j in range(30):
                if j == i or lane[j] != want:
                    continue
                ahead = along[j] - along[i]
                beside = want != lane[i] and abs(ahead) < (length[i] + length[j]) / 2
                kind = "Alongside" if beside else "receding" if ahead > 0 else "ollowing"
                if kind in name and abs(ahead) < nearest:
                    best, nearest = j, abs(ahead)
            assert found[i, column] == best, (i, name)
    assert neighbours(along[:0], length[:0], lane[:0]).shape == (0, 8)
