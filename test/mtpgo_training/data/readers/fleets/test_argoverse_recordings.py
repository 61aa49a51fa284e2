# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Argoverse 2 in its own files, made up: a scenario of the forecasting set, a log of sensors."""

import numpy as np
import pandas as pd
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings

pytest.importorskip("pyarrow")


def scenario(path, **changes):
    tracks = {"AV": "vehicle", "17": "bus", "x1": "pedestrian", "9": "static"}
    table = pd.DataFrame(
        [
            {
                "observed": k < 2,
                "track_id": track,
                "object_type": kind,
                "object_category": 2,
                "timestep": k,
                "position_x": 10.0 * i + k,
                "position_y": 5.0 - i,
                "heading": 0.25,
                "velocity_x": 10.0,
                "velocity_y": float(i),
                "scenario_id": "s",
                "city": "pittsburgh",
            }
            for i, (track, kind) in enumerate(tracks.items())
            for k in range(3)
        ]
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    table.assign(**changes).to_parquet(path)


def test_a_scenario(tmp_path):
    scenario(tmp_path / "val" / "s" / "scenario_s.parquet")
    (recording,) = load_recordings(tmp_path, "argoverse2")
    assert (recording.name, recording.location, recording.frame_rate) == ("s", "pittsburgh", 10.0)
    assert len(recording) == 9  # without the one that never moves
    assert sorted(recording.agent_class.tolist()) == [
        AgentClass.CAR,
        AgentClass.BUS,
        AgentClass.PEDESTRIAN,
    ]
    bus = int(np.flatnonzero(recording.agent_class == AgentClass.BUS)[0])
    rows = recording.track == bus
    np.testing.assert_allclose(recording.position[rows], [[10, 4], [11, 4], [12, 4]])
    np.testing.assert_allclose(recording.velocity[rows], [[10, 1]] * 3)
    np.testing.assert_allclose(recording.yaw, 0.25)
    ego = int(np.flatnonzero(recording.track_id == recording.ego_id)[0])
    np.testing.assert_allclose(recording.position[recording.track == ego][0], [0, 5])
    assert np.isnan(recording.size).all()


def test_a_log_is_brought_into_the_frame_of_the_city(tmp_path):
    folder = tmp_path / "sensor" / "log1"
    folder.mkdir(parents=True)
    quarter = {"qw": np.sqrt(0.5), "qx": 0.0, "qy": 0.0, "qz": np.sqrt(0.5)}
    times = [315_969_904_359_876_000 + k * 100_000_000 for k in range(3)]
    poses = [{"timestamp_ns": t, **quarter, "tx_m": 100.0, "ty_m": 2.0 * k, "tz_m": 0.0}
             for k, t in enumerate(times)]  # fmt: skip
    boxes = [
        {"timestamp_ns": t, "track_uuid": uuid, "category": category, "length_m": 4.0,
         "width_m": 2.0, "height_m": 1.0, **quarter, "tx_m": 10.0, "ty_m": 1.0, "tz_m": 0.0}
        for t in times[:2]
        for uuid, category in (("u1", "BUS"), ("u2", "BOLLARD"))
    ]  # fmt: skip
    pd.DataFrame(poses).to_feather(folder / "city_SE3_egovehicle.feather")
    pd.DataFrame(boxes).to_feather(folder / "annotations.feather")
    (recording,) = load_recordings(tmp_path, "argoverse2")
    assert (recording.name, recording.frame_rate, len(recording)) == ("log1", 10.0, 4)
    bus = int(np.flatnonzero(recording.agent_class == AgentClass.BUS)[0])
    rows = recording.track == bus
    # 10 m ahead and 1 m to the left of a vehicle that looks along +y.
    np.testing.assert_allclose(recording.position[rows], [[99, 10], [99, 12]])
    np.testing.assert_allclose(recording.yaw[rows], np.pi)
    np.testing.assert_allclose(recording.size[bus], [4, 2])
    np.testing.assert_allclose(recording.yaw[~rows], np.pi / 2)
    unset = pd.DataFrame(boxes).assign(qw=0.0, qz=0.0)
    unset["timestamp_ns"] = unset["timestamp_ns"].astype("uint64")
    unset.to_feather(folder / "annotations.feather")
    (recording,) = load_recordings(tmp_path, "argoverse2")
    assert np.isnan(recording.yaw[rows]).all()
    np.testing.assert_allclose(recording.position[rows], [[99, 10], [99, 12]])
    nowhere = pd.DataFrame(poses).assign(qw=[1.0, 0.0, 1.0], qz=0.0)
    nowhere.to_feather(folder / "city_SE3_egovehicle.feather")
    with pytest.raises(RecordingError, match=r"vehicle\.feather, row 2: the quaternion has no"):
        load_recordings(tmp_path, "argoverse2")
    pd.DataFrame(poses[:1]).to_feather(folder / "city_SE3_egovehicle.feather")
    sentence = r"annotations\.feather, row 3: city_SE3_egovehicle\.feather has no pose of the time"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path, "argoverse2")
    (folder / "city_SE3_egovehicle.feather").unlink()
    with pytest.raises(RecordingError, match=r"egovehicle\.feather is missing, it belongs to ann"):
        load_recordings(tmp_path, "argoverse2")


def test_defects(tmp_path):
    with pytest.raises(
        RecordingError, match=r"has no recordings, expected Argoverse 2's scenario"
    ):
        load_recordings(tmp_path, "argoverse2")
    path = tmp_path / "scenario_s.parquet"
    scenario(path, timestep=1)
    with pytest.raises(RecordingError, match=r"row 5: track 17 has a second row"):
        load_recordings(tmp_path, "argoverse2")
    scenario(path, position_x=np.inf)
    with pytest.raises(RecordingError, match=r"row 1, column 'position_x': 'inf', expected a fin"):
        load_recordings(tmp_path, "argoverse2")
    path.write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"scenario_s\.parquet cannot be read as Parquet"):
        load_recordings(tmp_path, "argoverse2")


def test_names_in_capitals_and_the_same_scenario_twice(tmp_path):
    scenario(tmp_path / "train" / "s" / "SCENARIO_s.PARQUET")
    (recording,) = load_recordings(tmp_path, "argoverse2")
    assert recording.name == "s"
    scenario(tmp_path / "val" / "s" / "scenario_s.parquet")
    with pytest.raises(RecordingError, match=r"has two recordings 's', .*SCENARIO_s\.PARQUET and"):
        load_recordings(tmp_path, "argoverse2")


def test_a_scenario_without_road_users_is_called_so(tmp_path):
    scenario(tmp_path / "scenario_s.parquet", object_type="static")
    with pytest.raises(
        RecordingError, match="has no road user: all of its 12 rows are objects th"
    ):
        load_recordings(tmp_path, "argoverse2")


def test_several_scenarios_in_one_file_are_refused(tmp_path):
    scenario(tmp_path / "scenario_s.parquet", scenario_id=["s"] * 6 + ["q"] * 6)
    with pytest.raises(RecordingError, match="has several scenarios, 's' and 'q', expected one"):
        load_recordings(tmp_path, "argoverse2")


def test_headings_in_degrees_are_remarked_on(tmp_path, caplog):
    scenario(tmp_path / "scenario_s.parquet", heading=90.0)
    load_recordings(tmp_path, "argoverse2")
    assert "half of the headings are beyond 90 rad, more than a full turn" in caplog.text
