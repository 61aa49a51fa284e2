# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""INTERACTION and SinD in their own folders and columns, made up."""

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording_cache import RecordingCache

VEHICLES = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"
PEDESTRIANS = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy\n"


def vehicle(track, frame, x, y=2.0):
    return f"{track},{frame},{frame * 100},car,{x},{y},10,-1,-3.2,4.5,1.8\n"


@pytest.fixture
def interaction(tmp_path):
    for place, number in (("DR_A", "000"), ("DR_A", "001"), ("DR_B", "000")):
        folder = tmp_path / "recorded_trackfiles" / place
        folder.mkdir(parents=True, exist_ok=True)
        rows = [vehicle(10, 1, 1), vehicle(2, 1, 5), vehicle(10, 2, 2), vehicle(2, 3, 7)]
        (folder / f"vehicle_tracks_{number}.csv").write_text(VEHICLES + "".join(rows))
    (tmp_path / "recorded_trackfiles/DR_A/pedestrian_tracks_000.csv").write_text(
        PEDESTRIANS + "P1,1,100,pedestrian/bicycle,8,9,1,0.5\n"
    )
    return tmp_path


def test_the_site_of_a_folder_that_was_renamed_is_not_the_one_in_the_cache(interaction, tmp_path):
    cache, folder = RecordingCache(tmp_path / "cache"), interaction / "recorded_trackfiles/DR_B"
    (recording,) = load_recordings(folder, "interaction", cache=cache)
    assert recording.location == "DR_B"
    folder = folder.rename(folder.with_name("DR_C"))
    (recording,) = load_recordings(folder, "interaction", cache=cache)
    assert recording.location == "DR_C"


def test_interaction(interaction, caplog):
    recordings = load_recordings(interaction, "interaction")
    assert [r.name for r in recordings] == ["DR_A-000", "DR_A-001", "DR_B-000"]
    (sentence,) = [record.getMessage() for record in caplog.records]
    assert "DR_A/pedestrian_tracks_000.csv: no class is known by the name 'pedestrian" in sentence
    both, alone, _ = recordings
    assert (both.frame_rate, both.location, alone.track_id.tolist()) == (10.0, "DR_A", [2, 10])
    assert alone.frame.tolist() == [0, 0, 1, 2]
    np.testing.assert_allclose(alone.position, [[5, 2], [1, 2], [2, 2], [7, 2]])
    np.testing.assert_allclose(alone.velocity, [[10, -1]] * 4)
    np.testing.assert_allclose(alone.yaw, 2 * np.pi - 3.2)
    np.testing.assert_allclose(alone.size, [[4.5, 1.8]] * 2)
    assert alone.track_key is None
    # With pedestrians: their numbers are text, so all are keys.
    assert both.track_key.shape == (3, 4)
    assert sorted(both.agent_class.tolist()) == [
        AgentClass.UNKNOWN,
        AgentClass.CAR,
        AgentClass.CAR,
    ]
    walker = int(np.flatnonzero(both.agent_class == AgentClass.UNKNOWN)[0])
    assert np.isnan(both.size[walker]).all()
    np.testing.assert_allclose(both.velocity[both.track == walker], [[1, 0.5]])
    assert [r.name for r in load_recordings(interaction, "interaction", ["DR_B-000"])] == [
        "DR_B-000"
    ]


def test_a_class_map_tells_what_pedestrian_or_bicycle_is(interaction, tmp_path):
    (tmp_path / "map.yaml").write_text("pedestrian/bicycle: bicycle\n")
    options = ReadingOptions(class_map=str(tmp_path / "map.yaml"))
    (recording,) = load_recordings(interaction, "interaction", ["DR_A-000"], options)
    assert AgentClass.BICYCLE in recording.agent_class


def test_the_cases_of_the_later_edition_are_recordings(tmp_path):
    (tmp_path / "train").mkdir()
    rows = ["1.0," + vehicle(1, f, f) for f in range(3)] + ["2.0," + vehicle(1, 5, 7)]
    (tmp_path / "train" / "DR_C_train.csv").write_text("case_id," + VEHICLES + "".join(rows))
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    recordings = load_recordings(tmp_path, "interaction")
    assert [(r.name, len(r)) for r in recordings] == [("DR_C_train-1", 3), ("DR_C_train-2", 1)]
    (recording,) = load_recordings(tmp_path, "interaction", ["DR_C_train-2"])
    assert (recording.name, len(recording)) == ("DR_C_train-2", 1)


def test_sind(tmp_path):
    folder = tmp_path / "Data" / "8_2_1"
    folder.mkdir(parents=True)
    head = (
        "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,yaw_rad,heading_rad,length,width,"
        "ax,ay,v_lon,v_lat,a_lon,a_lat\n"
    )
    rows = "".join(
        f"{t},{f},{f * 3 / 29.97 * 1000:.3f},{kind},{f},{t},1,2,0.5,0.9,3,1.5,0.1,0.2,0,0,0,0\n"
        for t, kind in ((1, "tricycle"), (2, "truck"))
        for f in range(30)
    )
    (folder / "Veh_smoothed_tracks.csv").write_text(head + rows)
    (folder / "Ped_smoothed_tracks.csv").write_text(
        PEDESTRIANS.replace("vy\n", "vy,ax,ay\n") + "P1,0,0,pedestrian,8,9,1,0.5,0,0\n"
    )
    (folder / "Veh_tracks_meta.csv").write_text("trackId\n1\n")
    (recording,) = load_recordings(tmp_path, "sind")
    assert (recording.name, recording.location) == ("8_2_1", "")  # one junction
    assert recording.frame_rate == pytest.approx(9.99)
    assert sorted(recording.agent_class.tolist()) == [
        AgentClass.TRUCK,
        AgentClass.MOTORCYCLE,
        AgentClass.PEDESTRIAN,
    ]
    known = np.isfinite(recording.yaw)
    np.testing.assert_allclose(recording.yaw[known], 0.5)
    assert known.sum() == 60
    np.testing.assert_allclose(recording.acceleration[recording.frame == 9], [[0.1, 0.2]] * 2)


def test_defects(tmp_path):
    with pytest.raises(RecordingError, match=r"has no recordings, expected INTERACTION's vehicle"):
        load_recordings(tmp_path, "interaction")
    with pytest.raises(RecordingError, match=r"has no recordings, expected SinD's Veh_smoothed"):
        load_recordings(tmp_path, "sind")
    path = tmp_path / "vehicle_tracks_000.csv"
    path.write_text(VEHICLES + vehicle(1, 1, 1) + vehicle(1, 1, 2))
    (tmp_path / "pedestrian_tracks_000.csv").write_text(PEDESTRIANS + "P1,1,100,car,8,9,1,0.5\n")
    sentence = r"vehicle_tracks_000\.csv, line 3: track 1 has a second row for time 0\.1 s"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path, "interaction")
    path.write_text(VEHICLES.replace("timestamp_ms", "time") + vehicle(1, 1, 1))
    with pytest.raises(RecordingError, match=r"vehicle_tracks_000\.csv has no column 'timestamp"):
        load_recordings(tmp_path, "interaction")


def test_other_files_beside_the_recordings_do_no_harm(interaction):
    before = [r.name for r in load_recordings(interaction, "interaction")]
    (interaction / "empty.csv").write_text("")
    (interaction / "notes.csv").write_bytes("a,b\n".encode("utf-16"))
    hidden = interaction / "recorded_trackfiles/DR_A/.ipynb_checkpoints"
    hidden.mkdir()
    (hidden / "vehicle_tracks_000-checkpoint.csv").write_text(VEHICLES)
    (interaction / "__MACOSX").mkdir()
    (interaction / "__MACOSX" / "._vehicle_tracks_000.csv").write_bytes(b"\0\5\x16\7")
    assert [r.name for r in load_recordings(interaction, "interaction")] == before


def test_a_file_of_cases_may_have_any_name(tmp_path):
    text = "case_id," + VEHICLES + f"3,{vehicle(1, 1, 0)}3,{vehicle(1, 2, 1)}"
    (tmp_path / "DR_A-train (1).csv").write_text(text)
    assert [r.name for r in load_recordings(tmp_path, "interaction")] == ["DR_A-train (1)-3"]
    (tmp_path / "DR_A-train (1).csv").write_text(text.replace(",", ";"))
    sentence = r"or files with a column case_id; it has DR_A-train \(1\)\.csv$"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path, "interaction")


def test_folders_behind_symbolic_links_are_looked_into(interaction, tmp_path_factory):
    folder = tmp_path_factory.mktemp("elsewhere") / "data"
    folder.mkdir()
    (folder / "loop").symlink_to(folder)
    (folder / "Z").symlink_to(interaction / "recorded_trackfiles" / "DR_B")
    assert [r.name for r in load_recordings(folder, "interaction")] == ["Z-000"]
    (folder / "all").symlink_to(interaction)
    names = [r.name for r in load_recordings(folder, "interaction")]
    assert len(names) == 3


@pytest.mark.parametrize("number", ["10", "2.0"])
def test_numbers_of_pedestrians_and_vehicles_are_told_apart(interaction, number):
    path = interaction / "recorded_trackfiles/DR_A/pedestrian_tracks_000.csv"
    path.write_text(PEDESTRIANS + f"{number},1,100,person,8,9,1,0.5\n")
    (both,) = load_recordings(interaction, "interaction", ["DR_A-000"])
    assert sorted(both.agent_class.tolist()) == [
        AgentClass.CAR,
        AgentClass.CAR,
        AgentClass.PEDESTRIAN,
    ]


def test_persons_belong_to_the_vehicles_of_the_same_number(tmp_path):
    (tmp_path / "vehicle_tracks_000.CSV").write_text(VEHICLES + vehicle(1, 1, 1))
    (tmp_path / "person_tracks_000.csv").write_text(PEDESTRIANS + "P1,1,100,person,8,9,1,0\n")
    (recording,) = load_recordings(tmp_path, "interaction")
    assert (recording.name, len(recording)) == ("000", 2)


def test_cases_with_large_numbers_and_their_sites(tmp_path):
    for part, site in (("train", "DR_A"), ("train", "DR_B"), ("val", "DR_A")):
        (tmp_path / part).mkdir(exist_ok=True)
        rows = "".join(f"{case}.0,{vehicle(1, 1, 1)}" for case in (1234567, 1234568))
        (tmp_path / part / f"{site}_{part}.csv").write_text("case_id," + VEHICLES + rows)
    recordings = load_recordings(tmp_path, "interaction")
    assert [r.name for r in recordings[:2]] == ["DR_A_train-1234567", "DR_A_train-1234568"]
    assert [r.location for r in recordings[::2]] == ["DR_A", "DR_A", "DR_B"]


def test_the_tables_of_another_data_set_are_not_taken(tmp_path):
    (tmp_path / "Veh_tracks_meta.csv").write_text("trackId\n1\n")
    with pytest.raises(RecordingError, match=r"has no recordings.*; it has Veh_tracks_meta\.csv$"):
        load_recordings(tmp_path, "interaction")


def test_the_cities_of_sind_are_its_sites(tmp_path):
    head = "track_id,frame_id,timestamp_ms,agent_type,x,y\n"
    for city, name in (("Changchun", "a"), ("Changchun", "b"), ("Xi'an", "c")):
        folder = tmp_path / "Data" / city / name
        folder.mkdir(parents=True)
        (folder / "Veh_smoothed_tracks.csv").write_text(head + "1,0,0,cars,1,2\n")
        (folder / "Ped_smoothed_tracks.csv").write_text(head + "1,9,900,pedestrian,8,9\n")
    recordings = load_recordings(tmp_path, "sind")
    assert [r.location for r in recordings] == ["Changchun", "Changchun", "Xi'an"]
    for recording in recordings:
        assert sorted(recording.agent_class) == [AgentClass.CAR, AgentClass.PEDESTRIAN]
