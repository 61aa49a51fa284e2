# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw NGSIM files: forms, feet, axes, headings, numbers used again, several sites in one file."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions

HEADER = (
    "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_length,"
    "v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Preceding,Following,Space_Headway,Time_Headway"
)
START_MS = 1_118_846_979_700


def row(vehicle: int, ms: int, x: float, y: float, *, kind: int = 2, speed: float = 40.0) -> str:
    time = f"{vehicle},{ms // 100},99,{START_MS + ms}"
    return f"{time},{x},{y},0,0,15.0,6.0,{kind},{speed},0.0,2,0,0,0,0"


def write(path: Path, rows: list[str], header: str = HEADER) -> None:
    path.write_text("\n".join([header, *rows]) + "\n")


def test_feet_and_axes(tmp_path: Path) -> None:
    write(
        tmp_path / "us101.csv", [row(7, 0, 10.0, 100.0, kind=3), row(7, 100, 10.0, 104.0, kind=3)]
    )
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert (recording.name, recording.frame_rate) == ("us101", 10.0)
    assert recording.stamp_ns(0) == START_MS * 10**6
    # The front at 100 ft along, 10 ft to the right; 15 ft long: the centre is 7.5 ft behind.
    np.testing.assert_allclose(recording.position[0], [(100 - 7.5) * 0.3048, -10 * 0.3048])
    np.testing.assert_allclose(recording.velocity[0], [40 * 0.3048, 0.0], atol=1e-12)
    np.testing.assert_allclose(recording.size, [[15 * 0.3048, 6 * 0.3048]])
    assert recording.agent_class.tolist() == [AgentClass.TRUCK]
    assert np.isnan(recording.acceleration).all()


def test_heading_turns_only_after_a_real_displacement(tmp_path: Path) -> None:
    # 1 ft (0.30 m) steps to the right: 2 m are reached after the seventh.
    rows = [row(1, 100 * i, 10.0 + i, 50.0) for i in range(12)]
    write(tmp_path / "a.csv", rows)
    (recording,) = load_recordings(tmp_path, "ngsim")
    np.testing.assert_allclose(recording.yaw[:7], 0.0)
    np.testing.assert_allclose(recording.yaw[7:], -math.pi / 2)
    write(tmp_path / "a.csv", rows[:9])
    (short,) = load_recordings(tmp_path, "ngsim")
    np.testing.assert_array_equal(short.yaw, recording.yaw[:9])


def test_numbers_used_again_and_rows_given_twice(tmp_path: Path) -> None:
    rows = [row(1, 0, 10, 50), row(1, 0, 10, 50), row(2, 0, 10, 90), row(1, 100, 10, 54)]
    rows += [row(1, 20_000, 10, 30), row(2, 100, 10, 94), row(1, 20_100, 10, 34)]
    write(tmp_path / "a.csv", rows)
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert recording.track_id.tolist() == [1, 2, 3]
    assert recording.frame.tolist() == [0, 0, 1, 1, 200, 201]
    assert recording.track.tolist() == [0, 1, 0, 1, 2, 2]


def test_sites_and_periods_become_recordings(tmp_path: Path) -> None:
    header = HEADER + ",Location,Direction"
    rows = [row(1, 0, 10, 50) + ",us-101,", row(1, 100_000, 10, 50) + ",us-101,"]
    rows += [row(1, 0, 10, 50) + ",lankershim,4", row(1, 100, 10, 49) + ",lankershim,4"]
    write(tmp_path / "all.csv", rows, header)
    recordings = load_recordings(tmp_path, "ngsim")
    assert [r.name for r in recordings] == ["all-lankershim", "all-us-101-1", "all-us-101-2"]
    # Southbound: the heading is against x, so the centre lies beyond the front.
    np.testing.assert_allclose(recordings[0].yaw, math.pi)
    np.testing.assert_allclose(recordings[0].position[0, 0], (50 + 7.5) * 0.3048)
    assert len({r.sha256 for r in recordings}) == 3


OLD = [row(v, 100 * f, 16.0, 100.0 + 4 * f + 60 * v) for v in (1, 2, 3) for f in range(12)]
ARTERIAL = "O_Zone,D_Zone,Int_ID,Section_ID,Direction,Movement"
PORTAL = HEADER.replace(",Preceding", f",{ARTERIAL},Preceding") + ",Location"


def portal(line: str) -> str:
    """The row of the old edition as the portal has it."""
    cells = line.split(",")
    return ",".join([*cells[:14], *[""] * 6, *cells[14:], "us-101"])


def thousands(line: str) -> str:
    cells = line.split(",")
    return ",".join(
        f'"{int(c):,}"' if c.isdigit() and int(c) > 999 else f'"{float(c):,}"' if "." in c else c
        for c in cells
    )


FORMS = {
    "csv": ("a.csv", [HEADER, *OLD]),
    "portal": ("a.csv", [PORTAL, *map(portal, OLD)]),
    "lower case": ("a.csv", [PORTAL.lower(), *map(portal, OLD)]),
    "thousands separators": ("a.csv", [PORTAL, *(thousands(portal(line)) for line in OLD)]),
    "names with blanks": ("a.csv", [HEADER.replace("_", " "), *OLD]),
    "csv without header": ("a.csv", OLD),
    "portal without header": ("a.csv", [portal(line) for line in OLD]),
    "text by blanks": ("a.txt", ["   " + line.replace(",", "   ") for line in OLD]),
    "text by tabs": ("a.txt", [line.replace(",", "\t") for line in OLD]),
    "tabs and header": ("a.txt", [line.replace(",", "\t") for line in [HEADER, *OLD]]),
    "text of an arterial": (
        "a.txt",
        [" ".join([*c[:14], *"000020", *c[14:]]) for c in (line.split(",") for line in OLD)],
    ),
    "blanks named csv": ("a.csv", [line.replace(",", " ") for line in OLD]),
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_reads_the_same(tmp_path: Path, name: str) -> None:
    write(tmp_path / "reference.csv", OLD)
    (reference,) = load_recordings(tmp_path / "reference.csv", "ngsim")
    (tmp_path / "reference.csv").unlink()
    file, lines = FORMS[name]
    (tmp_path / file).write_text("\n".join(lines) + "\n")
    (tmp_path / "readme.txt").write_text("Vehicle trajectories of a motorway\n1 2 3\n")
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert recording.name == "a"
    assert recording.track_id.tolist() == [1, 2, 3]
    for column in ("frame", "track", "position", "velocity", "yaw", "size", "agent_class"):
        np.testing.assert_allclose(getattr(recording, column), getattr(reference, column))
    assert recording.start_time_ns == reference.start_time_ns == START_MS * 10**6


def test_the_archives_have_a_recording_as_csv_and_as_text(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", OLD)
    (tmp_path / "a.txt").write_text("\n".join(OLD[:20]).replace(",", " "))
    (tmp_path / "b.txt").write_text("\n".join(OLD[:20]).replace(",", " "))
    assert [(r.name, len(r)) for r in load_recordings(tmp_path, "ngsim")] == [("a", 36), ("b", 20)]


def test_lengths_in_metres_are_told_by_the_header(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", OLD, HEADER.replace("Local_X", "Local_X (m)"))
    (recording,) = load_recordings(tmp_path, "ngsim")
    np.testing.assert_allclose(recording.position[0], [160 - 7.5, -16])
    np.testing.assert_allclose(recording.velocity[0], [40.0, 0.0], atol=1e-12)


def test_a_number_that_comes_back_elsewhere_is_another_vehicle(tmp_path: Path) -> None:
    # Two seconds later, half a kilometre upstream; and 60 ft further on, which is the same one.
    rows = [row(1, 0, 16, 2000), row(1, 100, 16, 2004), row(1, 2100, 16, 50), row(1, 2200, 16, 54)]
    rows += [row(2, 0, 16, 1000), row(2, 1500, 16, 1060)]
    write(tmp_path / "a.csv", rows)
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert recording.track_id.tolist() == [1, 2, 3]
    assert np.bincount(recording.track).tolist() == [2, 2, 2]


def test_a_number_given_twice_at_a_time_is_two_vehicles_if_their_frames_differ(
    tmp_path: Path,
) -> None:
    first = [row(1, 100 * f, 16, 2000 + 4 * f) for f in range(4)]
    second = [row(1, 100 * f, 16, 100 + 4 * f).replace(",99,", ",55,") for f in range(2, 6)]
    write(tmp_path / "a.csv", [*first, *second])
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert np.bincount(recording.track).tolist() == [4, 4]
    for track in (0, 1):
        steps = np.diff(recording.position[recording.track == track, 0])
        np.testing.assert_allclose(steps, 4 * 0.3048)


def test_a_class_map_has_priority(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", [row(1, 0, 10, 50, kind=2), row(2, 0, 10, 90, kind=3)])
    (tmp_path / "map.yaml").write_text("2: van\n3: bus\n")
    options = ReadingOptions(class_map=str(tmp_path / "map.yaml"))
    (recording,) = load_recordings(tmp_path, "ngsim", options=options)
    assert recording.agent_class.tolist() == [AgentClass.VAN, AgentClass.BUS]


def test_defects(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"has no recordings, expected NGSIM's \.csv files"):
        load_recordings(tmp_path, "ngsim")
    path = tmp_path / "a.csv"
    write(path, [row(1, 0, 10, 50), row(1, 0, 11, 50)])
    with pytest.raises(RecordingError, match=r"a\.csv, line 3: vehicle 1 has a second row"):
        load_recordings(tmp_path, "ngsim")
    write(path, [*OLD, row(1, 500, 10, 900)])
    with pytest.raises(RecordingError, match=r"a\.csv, line 38: vehicle 1 has a second row"):
        load_recordings(tmp_path, "ngsim")
    write(path, [row(1, 0, 10, 50)], HEADER.replace("v_length", "Length"))
    with pytest.raises(RecordingError, match=r"a\.csv has no column 'v_length'"):
        load_recordings(path, "ngsim")
    write(path, [row(1, 0, 10, 50).replace("15.0", "long")])
    with pytest.raises(RecordingError, match=r"line 2, column 'v_length': 'long'"):
        load_recordings(path, "ngsim")
    write(path, [])
    with pytest.raises(RecordingError, match=r"has no rows below its header"):
        load_recordings(path, "ngsim")
    write(path, [row(1, 0, 10, 50).replace(str(START_MS), "99999999999999")])
    with pytest.raises(RecordingError, match=r"line 2, column 'Global_Time': 99999999999999, exp"):
        load_recordings(path, "ngsim")
    path.write_text("1 2 3\n1 2 4\n")
    with pytest.raises(RecordingError, match=r"a\.csv has 3 columns and no header line, expected"):
        load_recordings(path, "ngsim")
    write(path, [row(1, 0, 10, 50)])
    path.write_text(path.read_text().replace(",", ";"))
    with pytest.raises(RecordingError, match=r"separates its columns by semicolons, expected com"):
        load_recordings(path, "ngsim")


@pytest.mark.parametrize("name", ["A.CSV", "A.TXT", "A.CSV.GZ"])
def test_names_in_capitals_are_found(tmp_path: Path, name: str) -> None:
    text = "\n".join([HEADER, row(7, 0, 10.0, 100.0)]) + "\n"
    if name.endswith(".TXT"):
        text = row(7, 0, 10.0, 100.0).replace(",", " ") + "\n"
    data = text.encode()
    (tmp_path / name).write_bytes(gzip.compress(data) if name.endswith(".GZ") else data)
    (recording,) = load_recordings(tmp_path, "ngsim")
    assert (recording.name, len(recording)) == ("A", 1)


def test_other_tables_beside_the_trajectories_are_passed_over(tmp_path, caplog):
    write(tmp_path / "a.csv", [row(1, 0, 10.0, 0.0)])
    write(tmp_path / "b.csv", [row(1, 0, 10.0, 0.0)], HEADER.replace("_", " "))
    (tmp_path / "detector.csv").write_text("Station,Lane,Volume\n1,2,3\n")
    assert [r.name for r in load_recordings(tmp_path, "ngsim")] == ["a", "b"]
    assert "detector.csv is passed over" in caplog.text


@pytest.mark.parametrize("least", [0, 1], ids=["a zero is there", "all could be thousands"])
def test_decimal_commas_are_no_thousands(tmp_path: Path, least: int) -> None:
    """With three decimals every number looks like one with groups of three digits."""

    def comma(value: float) -> str:
        return '"' + f"{value:.3f}".replace(".", ",") + '"'

    rows = [
        f"1,{i},9,{START_MS + 100 * i},{comma(least + 10.0)},{comma(least + 4.0 * i)},0,0,"
        f"{comma(15.0)},{comma(6.0)},2,{comma(40.0)},0,2,0,0,0,0"
        for i in range(5)
    ]
    write(tmp_path / "a.csv", rows)
    with pytest.raises(RecordingError, match=r"groups of three digits; is it the decimal mark\?$"):
        load_recordings(tmp_path, "ngsim")


def test_rows_of_another_rate_are_called_so(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", [row(1, 40 * i, 10, 50 + i) for i in range(9)])
    with pytest.raises(RecordingError, match=r"line 3: vehicle 1 has rows 40 ms apart, .* 100 ms"):
        load_recordings(tmp_path, "ngsim")
