# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Drone recordings by hand-worked numbers, and every defect by its sentence."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording import DEFAULT_START_NS
from mtpgo_training.data.recording_cache import RecordingCache

sys.path.insert(0, str(Path(__file__).parents[2]))
import drone_files


def test_highd_corner_becomes_centre_with_y_up(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_highd(tmp_path), "highd")
    assert recording.frame.tolist() == [1, 1, 2, 2, 2]
    assert recording.track_id[recording.track].tolist() == [1, 2, 1, 2, 3]
    # Row 0: x 100 + 5/2, y -(8 + 2/2); row 1: x 200 + 10/2, y -(26 + 2.5/2).
    np.testing.assert_allclose(recording.position[:2], [[102.5, -9.0], [205.0, -27.25]])
    np.testing.assert_allclose(recording.velocity[:2], [[-30.0, 0.0], [20.0, 2.0]])
    np.testing.assert_allclose(recording.acceleration[0], [0.5, -0.25])
    np.testing.assert_allclose(recording.size, [[5.0, 2.0], [10.0, 2.5], [4.0, 1.5]])
    classes = [AgentClass.CAR, AgentClass.TRUCK, AgentClass.CAR]
    assert recording.agent_class.tolist() == classes


def test_highd_heading_follows_motion_and_the_road_at_rest(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_highd(tmp_path), "highd")
    expected = [
        math.pi,
        math.atan2(2.0, 20.0),
        math.atan2(-3.0, -30.0),  # yVelocity 3 points down the picture: to the driver's left
        math.atan2(2.0, 20.0),
        math.pi,  # standing on the upper carriageway
    ]
    np.testing.assert_allclose(recording.yaw, expected)


def test_highd_markings_run_with_the_traffic(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_highd(tmp_path), "highd")
    assert len(recording.lanes) == 6
    np.testing.assert_allclose(recording.lanes[0], [[210.8, -8.5], [50.0, -8.5]])
    np.testing.assert_allclose(recording.lanes[5], [[50.0, -28.9], [210.8, -28.9]])


@pytest.mark.parametrize(
    ("old", "new", "lanes"),
    [
        (",21.0;25.1;28.9", ",", 3),
        (",8.5;12.6;16.4", ",nan", 3),
        ("8.5;12.6;16.4", "8.5;12.6;16.4;", 6),
        ("8.5;12.6;16.4,21.0;25.1;28.9", ",", 0),
    ],
)
def test_markings_may_be_missing(tmp_path: Path, old: str, new: str, lanes: int) -> None:
    meta = drone_files.write_highd(tmp_path) / "01_recordingMeta.csv"
    meta.write_text(meta.read_text().replace(old, new))
    (recording,) = load_recordings(tmp_path, "highd")
    assert len(recording.lanes) == lanes
    assert all(np.isfinite(lane).all() for lane in recording.lanes)


def test_ind_is_read_unchanged(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_ind(tmp_path), "ind")
    assert (recording.name, recording.location, recording.frame_rate) == ("07", "4", 10.0)
    np.testing.assert_allclose(recording.position[0], [10.0, -20.0])
    np.testing.assert_allclose(recording.velocity[0], [0.0, -8.0])
    np.testing.assert_allclose(recording.yaw, [-math.pi / 2, -math.pi / 2, math.pi / 4, math.pi])
    assert recording.agent_class.tolist() == [AgentClass.TRUCK, AgentClass.PEDESTRIAN]
    np.testing.assert_array_equal(recording.size, [[4.5, 2.0], [np.nan, np.nan]])
    assert np.isnan(recording.acceleration[2]).all()
    assert recording.lanes == ()


def test_gaps_stay_gaps_and_stamps_follow_the_frame_rate(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_ind(tmp_path), "ind")
    states = list(recording.states())
    assert [len(s) for s in states] == [1, 2, 1]
    assert [s.stamp_ns - DEFAULT_START_NS for s in states] == [0, 10**8, 3 * 10**8]
    assert states[1].key[:, 0].tolist() == [0, 5]
    assert recording.frames.tolist() == [0, 1, 3]
    assert recording.duration_s == pytest.approx(0.3)


def test_packed_files_read_the_same(tmp_path: Path) -> None:
    (plain,) = load_recordings(drone_files.write_highd(tmp_path), "highd")
    for path in list(tmp_path.iterdir()):
        drone_files.pack(path)
    (packed,) = load_recordings(tmp_path, "highd")
    np.testing.assert_array_equal(plain.position, packed.position)
    np.testing.assert_array_equal(plain.lanes[3], packed.lanes[3])


def test_folder_data_is_found_and_names_select(tmp_path: Path) -> None:
    for name in ("01", "02", "11"):
        drone_files.write_ind(tmp_path / "data", name)
    assert [r.name for r in load_recordings(tmp_path, "round")] == ["01", "02", "11"]
    assert [r.name for r in load_recordings(tmp_path, "ind", ["11", "1"])] == ["11", "01"]


def test_exid_lane_columns_with_several_values_are_ignored(tmp_path: Path) -> None:
    lines = drone_files.IND_TRACKS.splitlines()
    text = "\n".join(
        [lines[0] + ",laneletId,laneWidth"] + [x + ",12;13,3.5;3.6" for x in lines[1:]]
    )
    drone_files.write_recording(
        tmp_path, "00", text, drone_files.IND_TRACKS_META, drone_files.IND_RECORDING_META
    )
    (recording,) = load_recordings(tmp_path, "exid")
    assert len(recording) == 4
    with pytest.raises(RecordingError, match=r"has the layout 'exid', but 'ind' was asked for"):
        load_recordings(tmp_path, "ind")


def test_the_size_is_that_of_the_tracks_where_tracks_meta_differs(tmp_path: Path) -> None:
    # As in many recordings of exiD; a pedestrian has none in either.
    meta = drone_files.IND_TRACKS_META.replace("2.0,4.5,truck_bus", "1.9,16.5,truck_bus")
    drone_files.write_recording(
        tmp_path, "00", drone_files.IND_TRACKS, meta, drone_files.IND_RECORDING_META
    )
    (recording,) = load_recordings(tmp_path, "round")
    np.testing.assert_array_equal(recording.size, [[4.5, 2.0], [np.nan, np.nan]])
    # Without sizes in tracks, those of tracksMeta hold.
    text = drone_files.IND_TRACKS.replace(",width,length,", ",wide,long,")
    (tmp_path / "00_tracks.csv").write_text(text)
    (recording,) = load_recordings(tmp_path, "unid")
    np.testing.assert_array_equal(recording.size, [[16.5, 1.9], [np.nan, np.nan]])


def test_positions_alone_are_a_recording_of_the_layout(tmp_path: Path) -> None:
    tracks = "trackId,frame,xCenter,yCenter\n" + "".join(f"4,{f},{f},-2\n" for f in range(3))
    drone_files.write_recording(
        tmp_path, "00", tracks, "trackId,width,length,class\n4,2,4,car\n",
        "locationId,frameRate\n1,10\n",
    )  # fmt: skip
    (recording,) = load_recordings(tmp_path, "ind")
    np.testing.assert_array_equal(recording.position, [[0, -2], [1, -2], [2, -2]])
    assert np.isnan(recording.velocity).all()
    assert np.isnan(recording.yaw).all()
    # Half of the columns are a defect.
    (tmp_path / "00_tracks.csv").write_text(
        tracks.replace("yCenter", "yCenter,xVelocity").replace(",-2\n", ",-2,10\n")
    )
    with pytest.raises(RecordingError, match="has no column 'heading'"):
        load_recordings(tmp_path, "ind")


def test_a_class_map_reads_the_classes_of_tracks_meta(tmp_path: Path) -> None:
    directory = drone_files.write_ind(tmp_path / "data")
    (tmp_path / "map.yaml").write_text("truck_bus: bus\npedestrian: unknown\n")
    options = ReadingOptions(class_map=str(tmp_path / "map.yaml"))
    cache = RecordingCache(tmp_path / "cache")
    for given, classes in ((ReadingOptions(), [2, 7]), (options, [3, 0])):
        (recording,) = load_recordings(directory, "ind", options=given, cache=cache)
        assert recording.agent_class.tolist() == classes


def test_classes_that_are_not_known_are_named_once(tmp_path: Path, caplog) -> None:
    drone_files.write_ind(tmp_path)
    meta = tmp_path / "07_tracksMeta.csv"
    meta.write_text(meta.read_text().replace("truck_bus", "tram").replace("pedestrian", ""))
    (recording,) = load_recordings(tmp_path, "ind")
    assert recording.agent_class.tolist() == [0, 0]
    (record,) = caplog.records
    assert "07_tracksMeta.csv: no class is known by the name 'tram', --class-map" in record.message


def test_hash_covers_every_file(tmp_path: Path) -> None:
    directory = drone_files.write_ind(tmp_path)
    before = load_recordings(directory, "ind")[0].sha256
    meta = directory / "07_recordingMeta.csv"
    meta.write_text(meta.read_text().replace("monday", "friday"))
    assert load_recordings(directory, "ind")[0].sha256 != before


def test_parked_and_cut(tmp_path: Path) -> None:
    (recording,) = load_recordings(drone_files.write_ind(tmp_path), "ind")
    # Track 0 moves 2.4 m, track 5 has a single row.
    moving = recording.without_parked(moved_m=2.0)
    assert moving.track_id.tolist() == [0]
    assert moving.track.tolist() == [0, 0, 0]
    assert recording.between(0.1, 0.2).frame.tolist() == [1, 1]
    assert recording.between(0.1).duration_s == pytest.approx(0.2)


DEFECTS = {
    "no number": (
        "01_tracks.csv",
        ("200.8,25.92", "abc,25.92"),
        r"01_tracks\.csv, line 5, column 'x': 'abc', expected a number",
    ),
    "infinite": ("01_tracks.csv", ("-30.0,3.0", "inf,3.0"), r"line 3, column 'xVelocity': 'inf'"),
    "empty position": (
        "01_tracks.csv",
        ("50.0,9.0", ",9.0"),
        r"line 6, column 'x': an empty cell, expected a finite number",
    ),
    "fractional id": (
        "01_tracks.csv",
        ("2,3,50.0", "2,3.5,50.0"),
        r"line 6, column 'id': '3\.5', expected a whole number",
    ),
    "missing column": ("01_tracks.csv", ("xVelocity", "speed"), r"has no column 'xVelocity'"),
    "second row": (
        "01_tracks.csv",
        ("2,2,200.8", "1,2,200.8"),
        r"line 5: track 2 has a second row for frame 1",
    ),
    "unlisted track": (
        "01_tracksMeta.csv",
        ("3,4.0,1.5,2,2,1,Car,1,0.0,0,0,0,-1,-1,-1,0\n", ""),
        r"01_tracks\.csv, line 6: track 3 is not listed in 01_tracksMeta\.csv",
    ),
    "listed twice": (
        "01_tracksMeta.csv",
        ("3,4.0", "2,4.0"),
        r"01_tracksMeta\.csv, line 4: track 2 comes twice",
    ),
    "direction": (
        "01_tracksMeta.csv",
        ("Truck,2", "Truck,3"),
        r"01_tracksMeta\.csv, line 3, column 'drivingDirection': 3, expected 1",
    ),
    "frame rate": ("01_recordingMeta.csv", ("1,25,2", "1,0,2"), r"column 'frameRate': 0"),
    "marking": (
        "01_recordingMeta.csv",
        ("25.1", "x"),
        r"column 'lowerLaneMarkings': 'x', expected y positions joined by ';'",
    ),
    "marking without a value": (
        "01_recordingMeta.csv",
        ("25.1", "inf"),
        r"column 'lowerLaneMarkings': 'inf', expected y positions joined by ';'",
    ),
    "second row behind blank lines": (
        "01_tracks.csv",
        ("2,2,200.8", "\n\n1,2,200.8"),
        r"line 7: track 2 has a second row for frame 1",
    ),
    "ragged": (
        "01_tracks.csv",
        ("2,3,50.0", "2,3,1,50.0"),
        r"01_tracks\.csv, line 6: 26 cells, expected 25",
    ),
    "cut line": (
        "01_tracks.csv",
        (",0.0,0.0,0.0,0.0,50.0,370.0,0,0,0,0,0,0,0,0,0,0,0,0,2\n", ",0.0"),
        r"ends within line 6",
    ),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_defect_is_named_with_its_place(tmp_path: Path, defect: str) -> None:
    name, (old, new), sentence = DEFECTS[defect]
    drone_files.write_highd(tmp_path)
    text = (tmp_path / name).read_text()
    assert text.count(old) >= 1
    (tmp_path / name).write_text(text.replace(old, new, 1))
    with pytest.raises(RecordingError, match=sentence) as caught:
        load_recordings(tmp_path, "highd")
    assert "\n" not in str(caught.value)


def test_wrong_layouts_and_places(tmp_path: Path) -> None:
    drone_files.write_highd(tmp_path / "a")
    with pytest.raises(RecordingError, match=r"'foo' is unknown, expected one of highd, ind"):
        load_recordings(tmp_path / "a", "foo")
    with pytest.raises(RecordingError, match=r"has the layout 'highd', but 'ind' was asked for"):
        load_recordings(tmp_path / "a", "ind")
    with pytest.raises(RecordingError, match=r"has no recording '9', it has 01"):
        load_recordings(tmp_path / "a", "highd", ["9"])
    with pytest.raises(RecordingError, match=r"nowhere does not exist"):
        load_recordings(tmp_path / "nowhere", "highd")
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"empty has no recordings, expected files such as"):
        load_recordings(tmp_path / "empty", "highd")
    (tmp_path / "a" / "01_tracksMeta.csv").unlink()
    with pytest.raises(RecordingError, match=r"01_tracksMeta\.csv is missing"):
        load_recordings(tmp_path / "a", "highd")


@pytest.mark.parametrize("damage", ["truncated", "no gzip", "empty"])
def test_damaged_file_is_named(tmp_path: Path, damage: str) -> None:
    drone_files.write_ind(tmp_path)
    path = tmp_path / "07_tracks.csv"
    drone_files.pack(path)
    packed = tmp_path / "07_tracks.csv.gz"
    if damage == "truncated":
        packed.write_bytes(packed.read_bytes()[:-20])
    elif damage == "no gzip":
        packed.write_bytes(b"plain text")
    else:
        packed.unlink()
        path.write_text("")
    with pytest.raises(RecordingError, match=r"07_tracks\.csv.*(cannot be read|is empty)"):
        load_recordings(tmp_path, "ind")


def test_files_of_different_recordings_are_refused(tmp_path):
    drone_files.write_ind(tmp_path)
    tracks, meta = tmp_path / "07_tracks.csv", tmp_path / "07_recordingMeta.csv"
    text = meta.read_text()
    head, row = text.splitlines()[:2]
    place = head.split(",").index("recordingId")
    cells = row.split(",")
    cells[place] = "9"
    meta.write_text("\n".join([head, ",".join(cells)]) + "\n")
    sentence = r"07_tracks\.csv is of recording \d+, and 07_recordingMeta\.csv of recording 9, exp"
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path, "ind")
    meta.write_text(text)
    lines = tracks.read_text().splitlines()
    other = lines[-1].split(",")
    other[0], other[2] = "8", str(int(other[2]) + 1)
    tracks.write_text("\n".join([*lines, ",".join(other)]) + "\n")
    with pytest.raises(RecordingError, match=r"has rows of the recordings \d+ and 8, exp"):
        load_recordings(tmp_path, "ind")


@pytest.mark.parametrize("write", [drone_files.write_highd, drone_files.write_ind])
def test_rows_that_tracks_meta_lists_and_tracks_lacks_are_counted(tmp_path, caplog, write):
    layout = write.__name__.removeprefix("write_")
    write(tmp_path)
    load_recordings(tmp_path, layout)
    assert not caplog.records
    (tracks,) = tmp_path.glob("*_tracks.csv")
    lines = tracks.read_text().splitlines()
    tracks.write_text("\n".join(lines[:-1]) + "\n")
    load_recordings(tmp_path, layout)
    assert "_tracks.csv has not all rows of 1 of the " in caplog.text
    assert "_tracksMeta.csv, the first is track " in caplog.text


def test_a_recording_without_its_tracks_is_named(tmp_path: Path, caplog) -> None:
    for name in ("07", "08"):
        drone_files.write_ind(tmp_path, name)
    (tmp_path / "08_tracks.csv").unlink()
    (recording,) = load_recordings(tmp_path, "ind")
    assert recording.name == "07"
    (record,) = caplog.records
    assert record.getMessage() == (
        f"mtpgo: {tmp_path}/08_tracks.csv is missing, it belongs to 08_tracksMeta.csv: the"
        " recording is not read"
    )
    caplog.clear()
    load_recordings(tmp_path, "ind", ["07"])
    assert not caplog.records
