# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an error says of a directory or file that has another layout than the one asked for."""

import pytest
from drone_files import write_highd, write_ind

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.checks.layout_clues import contents_in_words, other_layout_of

VEHICLES = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"
NGSIM = "Vehicle_ID,Frame_ID,Global_Time,Local_X,Local_Y\n"
OPENACC = "Date,26,2,2019\nTime,Speed1,E1,N1\n"
FILES = {
    "DR_A/vehicle_tracks_000.csv": ("interaction", VEHICLES),
    "train/DR_A.csv": ("interaction", VEHICLES),
    "8_2_1/Veh_smoothed_tracks.csv": ("sind", "x"),
    "a/x_01_traj_ped_filtered.csv": ("dut", "x"),
    "seq_eth/obsmat.txt": ("eth_ucy", "x"),
    "a.csv": ("ngsim", NGSIM),
    "v1.0-mini/sample_annotation.json": ("nuscenes", "[]"),
    "val/0a/scenario_0a.parquet": ("argoverse2", "x"),
    "training.tfrecord-00000-of-01000": ("waymo", "x"),
    "drive.mcap": ("bag", "x"),
    "Vicolungo/part1.csv": ("openacc", OPENACC),
}


@pytest.mark.parametrize("name", FILES)
def test_the_layout_of_a_directory_is_named(tmp_path, name):
    layout, text = FILES[name]
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    asked = "sind" if layout == "ind" else "ind"
    assert contents_in_words(tmp_path, asked) == f"{path} is of the layout {layout!r}"
    with pytest.raises(RecordingError) as caught:
        load_recordings(tmp_path, asked)
    assert "has no recordings, expected files such as 01_tracks.csv" in str(caught.value)
    assert f"{path} is of the layout {layout!r}" in str(caught.value)


def test_files_of_the_layout_in_a_folder_below_are_pointed_at(tmp_path):
    write_ind(tmp_path / "inD-v1.0" / "data")
    with pytest.raises(RecordingError, match=r"gz; there are such files in .*inD-v1\.0/data$"):
        load_recordings(tmp_path, "round")


def test_files_are_listed_where_no_layout_is_recognised(tmp_path):
    assert contents_in_words(tmp_path, "ind") == ""
    for name in ("inD.zip", ".hidden", "b", "c/d", "e"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    assert contents_in_words(tmp_path, "ind") == "it has b, e, inD.zip and 1 more"
    with pytest.raises(RecordingError, match=r"has no bags, expected .*; it has b, e, inD\.zip"):
        load_recordings(tmp_path, "bag")


@pytest.mark.parametrize(("asked", "write", "found"), [
    ("ngsim", write_ind, "ind"), ("ngsim", write_highd, "highd"),
])  # fmt: skip
def test_a_file_read_as_another_layout_names_its_own(tmp_path, asked, write, found):
    write(tmp_path)
    for path in tmp_path.iterdir():
        if not path.name.endswith("_tracks.csv"):
            path.unlink()
    with pytest.raises(RecordingError, match=f"the layout '{found}'"):
        load_recordings(tmp_path, asked)


def test_alike_layouts_are_no_others(tmp_path):
    write_ind(tmp_path)
    assert other_layout_of(tmp_path / "07_tracks.csv", "unid") == ""
    assert other_layout_of(tmp_path / "07_tracks.csv", "openacc") == "ind"
    assert other_layout_of(tmp_path / "none.csv", "openacc") == ""


def test_a_single_file_of_another_layout_is_called_so(tmp_path):
    (tmp_path / "vehicle_tracks_000.csv").write_text(VEHICLES)
    with pytest.raises(
        RecordingError, match=r"000\.csv has no recordings, .*; it is of the layout 'i"
    ):
        load_recordings(tmp_path / "vehicle_tracks_000.csv", "sind")
