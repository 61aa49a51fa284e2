# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""OpenACC's files, made up: facts before the names, all cars in a row, gaps."""

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording_cache import RecordingCache

FACTS = (
    "Date,26,2,2019\nVehicle_order,A(one),B(two)\nNumber_of_vehicles,2\nACC,1\n"
    "Distance_setting,shortest\n"
)
ROWS = (
    "Time,Speed1,Lat1,Lon1,Alt1,E1,N1,U1,VE1,VN1,Speed2,E2,N2,U2,IVS1,Driver2\n"
    "100.0,5,0.7,0.1,200,10,20,1,3,4,5,4,20,1,6,ACC\n"
    "100.1,5,0.7,0.1,200,10.3,20.4,1,3,4,,,,,,\n"
    "100.2,5,0.7,0.1,200,10.6,20.8,1,3,4,5,5,20,1,6,ACC\n"
)


def test_a_platoon(tmp_path):
    (tmp_path / "Vicolungo").mkdir()
    (tmp_path / "Vicolungo" / "part2.csv").write_text(FACTS + ROWS)
    (recording,) = load_recordings(tmp_path, "openacc")
    assert (recording.name, recording.location) == ("Vicolungo-part2", "Vicolungo")
    assert (recording.frame_rate, recording.frame.tolist()) == (10.0, [0, 0, 1, 2, 2])
    np.testing.assert_allclose(recording.position[1:4], [[4, 20], [10.3, 20.4], [10.6, 20.8]])
    np.testing.assert_allclose(recording.velocity[:2], [[3, 4], [np.nan, np.nan]])
    assert recording.agent_class.tolist() == [AgentClass.CAR] * 2
    assert recording.track_id.tolist() == [1, 2]
    assert np.isnan(recording.yaw).all()


def test_the_campaign_of_a_folder_that_was_renamed_is_not_the_one_in_the_cache(tmp_path):
    cache, folder = RecordingCache(tmp_path / "cache"), tmp_path / "unsorted"
    folder.mkdir()
    (folder / "part2.csv").write_text(FACTS + ROWS)
    (recording,) = load_recordings(folder, "openacc", cache=cache)
    assert recording.location == "unsorted"
    (recording,) = load_recordings(folder.rename(tmp_path / "Ispra"), "openacc", cache=cache)
    assert recording.location == "Ispra"


def test_defects(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(FACTS)
    with pytest.raises(
        RecordingError, match="has no line of column names that begins with 'Time'"
    ):
        load_recordings(tmp_path, "openacc")
    path.write_text(FACTS + "Time,Speed1\n1,2\n")
    with pytest.raises(
        RecordingError, match="has no columns 'E1' and 'N1', expected a file of Op"
    ):
        load_recordings(tmp_path, "openacc")
    path.write_text(FACTS + ROWS.replace("10.3", "east"))
    with pytest.raises(RecordingError, match="line 8, column 'E1': 'east', expected a number"):
        load_recordings(tmp_path, "openacc")
    path.write_text(FACTS.replace("ACC,1\n", "ACC,1\n\n\n") + ROWS.replace("10.3", "east"))
    with pytest.raises(RecordingError, match="line 10, column 'E1': 'east', expected a number"):
        load_recordings(tmp_path, "openacc")


def test_rows_without_any_position_are_called_so(tmp_path):
    path = tmp_path / "A.CSV"
    path.write_text(FACTS + "Time,E1,N1\n0.0,,\n0.1,,\n")
    with pytest.raises(RecordingError, match="has no position of a car in its 2 rows, expected v"):
        load_recordings(tmp_path, "openacc")


def test_other_tables_beside_the_campaigns_are_passed_over(tmp_path, caplog):
    (tmp_path / "part1.csv").write_text(FACTS + ROWS)
    (tmp_path / "readme.csv").write_text("a,b\n1,2\n")
    assert [r.name for r in load_recordings(tmp_path, "openacc")] == ["part1"]
    assert "readme.csv is passed over" in caplog.text


def test_another_separator_and_times_of_day_are_called_so(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text((FACTS + ROWS).replace(",", ";"))
    with pytest.raises(RecordingError, match=r"separates its columns by semicolons, expected com"):
        load_recordings(tmp_path, "openacc")
    path.write_text(FACTS + ROWS.replace("100.0,", "12:00:00.0,"))
    with pytest.raises(RecordingError, match=r"column 'Time': '12:00:00\.0', expected a number$"):
        load_recordings(tmp_path, "openacc")
