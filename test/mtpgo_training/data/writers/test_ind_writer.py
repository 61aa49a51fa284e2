# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in inD's layout: read back, and with derived columns worked out by hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
from road_scene import SCENE

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.ind_writer import write_ind


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
    assert [line.tolist() for line in back.lanes] == [line.tolist() for line in scene.lanes]
    write_ind(dataclasses.replace(scene, lanes=()), tmp_path, compress=False)
    (back,) = load_recordings(tmp_path, "ind")
    assert back.lanes == ()  # those of the earlier recording are gone


def classes(*names: AgentClass) -> np.ndarray:
    return np.array(names, dtype=np.uint8)


def test_rows_are_sorted_by_track_and_time_and_count_from_its_first_frame(tmp_path: Path) -> None:
    late = SCENE.select_rows((SCENE.track != 1) | (SCENE.frame == 2))  # track 2 from frame 2 on
    tracks, meta, _ = (pd.read_csv(p) for p in write_ind(late, tmp_path, compress=False))
    assert tracks["trackId"].tolist() == [1, 1, 2, 3, 3, 4, 4]
    assert tracks["frame"].tolist() == [1, 2, 2, 1, 2, 1, 2]
    assert tracks["trackLifetime"].tolist() == [0, 1, 0, 0, 1, 0, 1]
    assert meta["initialFrame"].tolist() == [1, 2, 1, 1]
    assert meta["finalFrame"].tolist() == [2, 2, 2, 2]
    assert meta["numFrames"].tolist() == [2, 1, 2, 2]


def test_classes_that_ind_lacks_become_its_nearest(tmp_path: Path) -> None:
    scene = dataclasses.replace(
        SCENE,
        agent_class=classes(
            AgentClass.BUS, AgentClass.TRAILER, AgentClass.VAN, AgentClass.MOTORCYCLE
        ),
    )
    _, meta, _ = (pd.read_csv(p) for p in write_ind(scene, tmp_path, compress=False))
    assert meta["class"].tolist() == ["truck_bus", "truck_bus", "car", "motorcycle"]


def test_pedestrians_and_bicycles_count_as_vulnerable_road_users(tmp_path: Path) -> None:
    scene = dataclasses.replace(
        SCENE,
        name="17",
        agent_class=classes(
            AgentClass.PEDESTRIAN, AgentClass.CAR, AgentClass.BICYCLE, AgentClass.MOTORCYCLE
        ),
    )
    tracks, _, general = (pd.read_csv(p) for p in write_ind(scene, tmp_path, compress=False))
    row = general.iloc[0]
    assert (row.numTracks, row.numVehicles, row.numVRUs) == (4, 2, 2)
    assert (row.recordingId, row.frameRate, row.duration) == (17, 25, 0.04)
    assert set(tracks["recordingId"]) == {17}


def test_headings_are_degrees_from_0_to_360(tmp_path: Path) -> None:
    scene = dataclasses.replace(SCENE, yaw=np.full(len(SCENE), -np.pi / 4))
    path, *_ = write_ind(scene, tmp_path, compress=False)
    assert set(pd.read_csv(path)["heading"]) == {315.0}
