# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finding the three files of a recording, and the layout that their header shows."""

import pytest
from drone_files import HIGHD_TRACKS, IND_TRACKS, pack, write_ind

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.drone_files import (
    check_layout,
    detect_layout,
    existing_directory,
    find_drone_files,
    select_names,
    visible_files,
)

AVAILABLE = ["01", "02", "10", "a"]


def test_numbers_find_names_with_leading_zeros(tmp_path):
    assert select_names(AVAILABLE, None, tmp_path) == AVAILABLE
    assert select_names(AVAILABLE, [], tmp_path) == AVAILABLE
    assert select_names(AVAILABLE, ["10", "1", "01", "002"], tmp_path) == ["10", "01", "02"]


def test_an_exact_name_comes_before_its_number(tmp_path):
    assert select_names(["1", "01", "001"], ["01"], tmp_path) == ["01"]
    assert select_names(["1", "001"], ["01"], tmp_path) == ["1", "001"]


def test_a_name_that_is_not_there_is_reported_with_those_that_are(tmp_path):
    with pytest.raises(RecordingError, match="has no recording 'b', it has 01, 02, 10, a"):
        select_names(AVAILABLE, ["01", "b"], tmp_path)
    with pytest.raises(RecordingError, match="has no recording '1,b', it has 01, 02, 10, a"):
        select_names(AVAILABLE, ["1,b"], tmp_path)


def test_names_with_commas_between_them_are_told_to_be_separated_by_blanks(tmp_path):
    with pytest.raises(RecordingError, match="'1,a', names are separated by blanks: 1 a"):
        select_names(AVAILABLE, ["1,a"], tmp_path)
    assert select_names(["1,a", "1", "a"], ["1,a"], tmp_path) == ["1,a"]


def test_recordings_are_found_by_their_tracks_sorted_by_name(tmp_path):
    for name in ("11", "02"):
        write_ind(tmp_path, name)
    (tmp_path / "notes_tracks.txt").write_text("")
    found = find_drone_files(tmp_path)
    assert [files.name for files in found] == ["02", "11"]
    assert [path.name for path in found[0].all] == [
        "02_tracks.csv",
        "02_tracksMeta.csv",
        "02_recordingMeta.csv",
    ]


def test_plain_and_packed_files_may_be_mixed_and_plain_ones_come_first(tmp_path):
    write_ind(tmp_path, "01")
    pack(tmp_path / "01_tracks.csv")
    pack(tmp_path / "01_recordingMeta.csv")
    (files,) = find_drone_files(tmp_path)
    names = ["01_tracks.csv.gz", "01_tracksMeta.csv", "01_recordingMeta.csv.gz"]
    assert [path.name for path in files.all] == names
    write_ind(tmp_path, "01")
    assert find_drone_files(tmp_path)[0].tracks.name == "01_tracks.csv"


def test_files_of_the_directory_come_before_those_of_its_folder_data(tmp_path):
    write_ind(tmp_path / "data", "05")
    assert find_drone_files(tmp_path)[0].tracks.parent == tmp_path / "data"
    write_ind(tmp_path, "01")
    assert [files.name for files in find_drone_files(tmp_path)] == ["01"]


@pytest.mark.parametrize(
    ("header", "layout"),
    [
        (HIGHD_TRACKS.splitlines()[0], "highd"),
        (IND_TRACKS.splitlines()[0], "ind"),
        (IND_TRACKS.splitlines()[0] + ",laneletId", "exid"),
        ("Vehicle_ID,Frame_ID,Local_X,Local_Y", "ngsim"),
        ("vehicle_id,frame_id,local_x,local_y", "ngsim"),
        ("track_id,frame_id,timestamp_ms,agent_type,x,y,psi_rad", "interaction"),
        ("track_id,frame_id,timestamp_ms,agent_type,x,y,yaw_rad", "sind"),
        ("time,x,y", None),
    ],
)
def test_the_header_shows_the_layout(tmp_path, header, layout):
    path = tmp_path / "01_tracks.csv"
    path.write_text(header + "\n")
    assert detect_layout(path) == layout


def test_another_layout_is_refused_and_an_unknown_header_is_not(tmp_path):
    path = tmp_path / "01_tracks.csv"
    path.write_text(HIGHD_TRACKS)
    check_layout(path, "highd", {"highd"})
    with pytest.raises(RecordingError, match="has the layout 'highd', but 'round' was asked for"):
        check_layout(path, "round", {"ind", "round"})
    path.write_text("time,x,y\n")
    check_layout(path, "round", {"ind", "round"})


def test_a_directory_is_expected(tmp_path):
    assert existing_directory(tmp_path) == tmp_path
    (tmp_path / "f").write_text("")
    for name, state in (("f", "is a file"), ("g", "does not exist")):
        with pytest.raises(RecordingError, match=f"{name} {state}, expected a directory with rec"):
            existing_directory(tmp_path / name)


def test_hidden_files_are_no_recordings(tmp_path):
    write_ind(tmp_path, "01")
    for path in list(tmp_path.iterdir()):
        (tmp_path / f"._{path.name}").write_bytes(b"\0\5\x16\7\0\2\0\0Mac OS X")
    assert [files.name for files in find_drone_files(tmp_path)] == ["01"]
    copies = tmp_path / ".ipynb_checkpoints"
    copies.mkdir()
    (copies / "a.csv").write_text("")
    assert visible_files([copies / "a.csv", tmp_path / "b.csv"], tmp_path) == [tmp_path / "b.csv"]
    assert visible_files([copies / "a.csv"], copies) == [copies / "a.csv"]


def test_names_in_capitals_are_found(tmp_path):
    write_ind(tmp_path, "01")
    pack(tmp_path / "01_tracks.csv")
    for path in list(tmp_path.iterdir()):
        path.rename(path.with_name(path.name.upper()))
    (files,) = find_drone_files(tmp_path)
    assert files.name == "01"
    names = ["01_TRACKS.CSV.GZ", "01_TRACKSMETA.CSV", "01_RECORDINGMETA.CSV"]
    assert [path.name for path in files.all] == names
    assert detect_layout(files.tracks) == "ind"
