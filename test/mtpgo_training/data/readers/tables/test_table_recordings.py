# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plain tables of any names: units, axes, times, classes, several recordings, and defects."""

import gzip

import numpy as np
import pytest
import yaml

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import AgentClass
from mtpgo_training import cli
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording import DEFAULT_START_NS

POSITIONS = {"columns": {"track": "id", "frame": "f", "x": "x", "y": "y"}, "frame_rate": 10}
ROWS = "f,id,x,y\n" + "".join(f"{f},{i},{f + 10 * i},{-i}\n" for i in (2, 10) for f in range(5))


@pytest.fixture
def read(tmp_path):
    """A table and the description of its columns, read."""

    def read(text, description, name="a.csv", **options):
        (tmp_path / "data").mkdir(exist_ok=True)
        data = text.encode() if isinstance(text, str) else text
        (tmp_path / "data" / name).write_bytes(data)
        path = tmp_path / "columns.yaml"
        content = description if isinstance(description, str) else yaml.safe_dump(description)
        path.write_text(content)
        options = ReadingOptions(columns=path, **options)
        return load_recordings(tmp_path / "data", "table", options=options)

    return read


def test_positions_alone(read):
    (recording,) = read(ROWS, POSITIONS)
    assert (recording.name, recording.layout, recording.frame_rate) == ("a", "table", 10.0)
    assert recording.track_id.tolist() == [2, 10]
    assert recording.frame.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    np.testing.assert_allclose(recording.position[:3], [[20, -2], [100, -10], [21, -2]])
    for unknown in (recording.velocity, recording.acceleration, recording.yaw, recording.size):
        assert np.isnan(unknown).all()
    assert (recording.agent_class == AgentClass.UNKNOWN).all()
    assert recording.stamp_ns(0) == DEFAULT_START_NS


def test_everything_in_other_units_with_y_down(read):
    text = (
        "when;who;px;py;u;v;a;b;psi;l;w;what\n"
        "1700000000100;P1;100,0;200,0;36;18;3,6;7,2;90;20;10;tram\n"
        "1700000000000;P1;90,0;200,0;;;;;450;20;10;\n"
    )
    description = {
        "columns": {
            "track": "who", "time": "when", "x": "px", "y": "py", "vx": "u", "vy": "v",
            "ax": "a", "ay": "b", "heading": "psi", "length": "l", "width": "w", "class": "what",
        },
        "unit": "ft", "time_unit": "ms", "speed_unit": "km/h", "heading_unit": "deg",
        "y_axis": "down", "separator": ";", "decimal": ",", "location": "here",
    }  # fmt: skip
    (classes := read.__closure__[0].cell_contents / "classes.yaml").write_text("tram: bus\n")
    (recording,) = read(text, description, class_map=str(classes))
    assert (recording.frame_rate, recording.location) == (10.0, "here")
    assert recording.start_time_ns == 1_700_000_000 * 10**9
    np.testing.assert_allclose(recording.position, [[90 * 0.3048, -60.96], [30.48, -60.96]])
    np.testing.assert_allclose(recording.velocity, [[np.nan, np.nan], [10.0, -5.0]])
    np.testing.assert_allclose(recording.acceleration[1], [1.0, -2.0])
    np.testing.assert_allclose(recording.yaw, -np.pi / 2)
    np.testing.assert_allclose(recording.size, [[6.096, 3.048]])
    assert recording.agent_class.tolist() == [AgentClass.BUS]
    np.testing.assert_array_equal(recording.key, keys_from_texts(["P1"]))


@pytest.mark.parametrize(
    "name", ["-1", "car 7", "99999999999999999999", "1.5", "\N{SUPERSCRIPT TWO}"]
)
def test_road_users_may_have_any_name(read, name):
    (recording,) = read(ROWS.replace(",2,", f",{name},"), POSITIONS)
    assert len(recording.track_id) == 2
    assert recording.find_tracks(keys_from_texts([name])) >= 0
    assert recording.find_tracks(keys_from_texts(["10"])) >= 0


def test_speed_along_the_heading_and_a_class_for_all(read):
    description = {
        "columns": POSITIONS["columns"] | {"speed": "v", "heading": "h"},
        "frame_rate": 25, "class": "pedestrian", "heading_unit": "deg",
    }  # fmt: skip
    (recording,) = read("f,id,x,y,v,h\n0,1,0,0,2,180\n10,1,0,0,2,180\n", description)
    np.testing.assert_allclose(recording.velocity, [[-2.0, 0.0]] * 2, atol=1e-12)
    assert recording.agent_class.tolist() == [AgentClass.PEDESTRIAN]
    assert (recording.frame.tolist(), recording.frame_rate) == ([0, 1], 2.5)


@pytest.mark.parametrize("form", ["tabs", "blanks", "no header", "gzip", "float ids"])
def test_forms_of_text(read, form):
    description = dict(POSITIONS)
    text, name = ROWS, "a.csv"
    if form == "tabs":
        text, name, description["separator"] = ROWS.replace(",", "\t"), "a.tsv", "\t"
    elif form == "blanks":
        text, name, description["separator"] = ROWS.replace(",", "   "), "a.txt", " "
    elif form == "no header":
        text, description["names"] = ROWS.partition("\n")[2], ["f", "id", "x", "y"]
    elif form == "gzip":
        text, name = gzip.compress(ROWS.encode()), "a.csv.gz"
    else:
        text = ROWS.replace(",2,", ",2.0,").replace(",10,", ",10.0,")
    (recording,) = read(text, description, name)
    assert (recording.name, len(recording)) == ("a", 10)
    assert recording.track_id.tolist() == [2, 10]


def test_parquet_reads_the_same(read, tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    (plain,) = read(ROWS, POSITIONS)
    (tmp_path / "data" / "a.csv").unlink()
    lines = [line.split(",") for line in ROWS.split()]
    table = pandas.DataFrame(lines[1:], columns=lines[0]).astype({"f": int, "x": "float32"})
    table.to_parquet(tmp_path / "b.parquet")
    content = (tmp_path / "b.parquet").read_bytes()
    (recording,) = read(content, POSITIONS, "b.parquet")
    np.testing.assert_array_equal(recording.position, plain.position)
    np.testing.assert_array_equal(recording.track, plain.track)
    (tmp_path / "data" / "b.parquet").unlink()
    sentence = r"b\.parquet, row 2, column 'y': 'far', expected a number"
    table.assign(y=["0", "far"] * 5).to_parquet(tmp_path / "b.parquet")
    with pytest.raises(RecordingError, match=sentence):
        read((tmp_path / "b.parquet").read_bytes(), POSITIONS, "b.parquet")
    with pytest.raises(RecordingError, match=r"b\.parquet cannot be read as Parquet"):
        read(content[:-9], POSITIONS, "b.parquet")
    dates = pandas.date_range("2024-05-01T12:00", periods=10, freq="100ms", tz="UTC")
    table.assign(f=dates).to_parquet(tmp_path / "b.parquet")
    by_time = {"columns": {"track": "id", "time": "f", "x": "x", "y": "y"}}
    (recording,) = read((tmp_path / "b.parquet").read_bytes(), by_time, "b.parquet")
    assert (recording.frame_rate, recording.start_time_ns) == (10.0, 1_714_564_800 * 10**9)


def test_dates_and_several_recordings_in_a_file(read):
    text = "t,id,x,y,run\n" + "".join(
        f"2024-05-01T12:00:0{s}.{d}+02:00,1,{s + d / 10},0,{run}\n"
        for run in ("b", "a")
        for s in (0, 1)
        for d in (0, 5)
    )
    description = {
        "columns": {"track": "id", "time": "t", "x": "x", "y": "y", "recording": "run"},
        "time_unit": "date",
    }
    recordings = read(text, description)
    assert [(r.name, len(r), r.frame_rate) for r in recordings] == [
        ("a-a", 4, 2.0),
        ("a-b", 4, 2.0),
    ]
    assert recordings[0].start_time_ns == 1_714_557_600 * 10**9
    assert recordings[0].sha256 != recordings[1].sha256
    with pytest.raises(RecordingError, match=r"line 3: the time '12 o clock', expected a date"):
        read(text.replace("2024-05-01T12:00:00.5+02:00", "12 o clock", 1), description)


DESCRIPTIONS = {
    "no mapping": ("- a\n", "has no mapping 'columns', expected for example columns: {track"),
    "unknown column": (
        {"columns": POSITIONS["columns"] | {"colour": "c"}, "frame_rate": 10},
        "has the unknown field 'colour', expected track, x, y, time",
    ),
    "unknown field": (POSITIONS | {"fps": 3}, "has the unknown field 'fps'"),
    "no x": (
        {"columns": {"track": "a", "time": "t", "y": "y"}},
        "columns.x is '', expected a",
    ),
    "no time": (
        {"columns": {"track": "a", "x": "x", "y": "y"}},
        "columns names neither of time and frame, expected one of them",
    ),
    "no rate": ({"columns": POSITIONS["columns"]}, "frame_rate is missing, expected frames per s"),
    "unit": (POSITIONS | {"unit": "px"}, "unit is 'px', expected one of 'm', 'km'"),
    "half a velocity": (
        {"columns": POSITIONS["columns"] | {"vx": "u"}, "frame_rate": 10},
        "columns.vy is missing, expected it beside columns.vx",
    ),
    "speed alone": (
        {"columns": POSITIONS["columns"] | {"speed": "u"}, "frame_rate": 10},
        "columns.speed is given without columns.heading",
    ),
    "twice": (
        {"columns": POSITIONS["columns"] | {"y": "x"}, "frame_rate": 10},
        "columns.y is 'x', which is columns.x already",
    ),
    "separator": (POSITIONS | {"separator": ";;"}, "separator is ';;', expected one character"),
    "sign": (
        POSITIONS | {"thousands": "-"},
        "thousands is '-', expected a mark that is no letter",
    ),
    "digit": (POSITIONS | {"separator": "2"}, "separator is '2', expected a mark that is no let"),
    "quote": (POSITIONS | {"separator": '"'}, "expected a mark that is no letter, digit, sign, q"),
    "no ASCII": (
        POSITIONS | {"separator": "\N{SECTION SIGN}"},
        "expected a character of ASCII",
    ),
    "rate": (POSITIONS | {"frame_rate": 0}, "frame_rate is 0.0, expected more than 0"),
    "yaml": ("columns: {", "cannot be read as YAML: "),
}


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_a_bad_description_is_one_sentence(read, name):
    description, sentence = DESCRIPTIONS[name]
    with pytest.raises(ConfigurationError) as caught:
        read(ROWS, description)
    assert "columns.yaml" in str(caught.value)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


TABLES = {
    "missing column": (ROWS.replace("f,id", "f,name"), "a.csv has no column 'id', expected the c"),
    "separator": (ROWS.replace(",", ";"), "separates its columns by semicolons, expected commas"),
    "cell": (ROWS.replace("1,2,21,-2", "1,2,east,-2"), "line 3, column 'x': 'east', expected a n"),
    "empty cell": (ROWS.replace("1,2,21,-2", ",2,21,-2"), "line 3, column 'f': an empty cell"),
    "no track": (ROWS.replace("1,2,21", "1,,21"), "line 3: the road user has no name"),
    "half a frame": (
        ROWS.replace("1,2,21", "1.5,2,21"),
        "line 3, column 'f': '1.5', expected a",
    ),
    "second row": (ROWS + "4,2,0,0\n", "line 12: track 2 has a second row for frame 4"),
    "far frame": (ROWS + "999999999999999,2,0,0\n", "line 12: 1e+14 s from other rows, expected"),
    "no rows": ("f,id,x,y\n", "a.csv has no rows, expected at least one"),
    "empty": ("", "a.csv is empty, expected a CSV file with a header line"),
}


@pytest.mark.parametrize("name", TABLES)
def test_a_bad_table_is_one_sentence_with_its_place(read, name):
    text, sentence = TABLES[name]
    with pytest.raises(RecordingError) as caught:
        read(text, POSITIONS)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_the_command_line_says(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(ROWS)
    (tmp_path / "c.yaml").write_text(yaml.safe_dump(POSITIONS))
    command = ["convert", "table", str(tmp_path), "-o", str(tmp_path / "a.mcap")]
    assert cli.main(command) == 2
    assert "the layout 'table' needs --columns FILE" in capsys.readouterr().err
    assert cli.main([*command, "--columns", str(tmp_path / "none.yaml")]) == 2
    assert "none.yaml, which is no file, expected one with the columns" in capsys.readouterr().err
    assert cli.main([*command, "--class-map", "kitti"]) == 2
    assert "class map 'kitti' is neither a preset nor a file" in capsys.readouterr().err
    assert cli.main([*command, "--columns", str(tmp_path / "c.yaml")]) == 0
    assert "1 recording(s) (a), 0.4 s, 5 frames" in capsys.readouterr().out


RUNS = {"columns": {"track": "id", "time": "t", "x": "x", "y": "y", "recording": "run"}}


def test_a_row_without_a_recording_is_refused_and_blanks_around_its_name_are_not_part_of_it(read):
    text = "t,id,x,y,run\n0,1,0,0,a \n1,1,1,0,a\n"
    assert [r.name for r in read(text, RUNS)] == ["a"]
    for cell in ("", " ", "nan"):
        sentence = "line 5: the recording has no name, expected one in each row"
        with pytest.raises(RecordingError, match=sentence):
            read(text + f"\n2,1,2,0,{cell}\n", RUNS)


def test_the_row_of_a_second_time_is_that_of_the_file(read):
    with pytest.raises(RecordingError, match="line 14: track 2 has a second row for frame 4"):
        read(ROWS.replace("\n0,2,", "\n\n\n0,2,") + "4,2,0,0\n", POSITIONS)


@pytest.fixture
def parquet(read, tmp_path):
    """A table with columns t (0.1 s apart), id, x, y, changed, and read."""
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")

    def parquet(description, **columns):
        table = pandas.DataFrame({"t": np.arange(6) / 10, "id": 7, "x": np.arange(6.0), "y": 0.0})
        table.assign(**columns).to_parquet(tmp_path / "b.parquet")
        return read((tmp_path / "b.parquet").read_bytes(), description, "b.parquet")

    return parquet


BY_TIME = {"columns": {"track": "id", "time": "t", "x": "x", "y": "y"}}


@pytest.mark.parametrize("unit", ["s", "ms", "date"])
def test_dates_of_parquet_have_their_own_unit(parquet, unit):
    pandas = pytest.importorskip("pandas")
    times = pandas.date_range("2024-05-01T12:00", periods=6, freq="100ms")
    (recording,) = parquet(BY_TIME | {"time_unit": unit}, t=times)
    assert (recording.frame_rate, recording.duration_s) == (10.0, 0.5)
    assert recording.start_time_ns == 1_714_564_800 * 10**9
    with pytest.raises(RecordingError, match="row 3: the time an empty cell, expected a date"):
        parquet(BY_TIME | {"time_unit": unit}, t=times.where(np.arange(6) != 2))


@pytest.mark.parametrize("unit", ["s", "ns", "date"])
def test_durations_of_parquet_have_their_own_unit(parquet, unit):
    pandas = pytest.importorskip("pandas")
    times = pandas.timedelta_range("2s", periods=6, freq="100ms").to_series(index=range(6))
    (recording,) = parquet({**BY_TIME, "time_unit": unit}, t=times)
    assert (recording.frame_rate, recording.duration_s) == (10.0, 0.5)
    with pytest.raises(RecordingError, match="row 3, column 't': an empty cell, expected a finit"):
        parquet({**BY_TIME, "time_unit": unit}, t=times.where(times.index != 2))


def test_nested_columns_of_parquet(parquet):
    pose = [{"position": {"x": float(i), "y": 2.0}, "note": "a"} for i in range(6)]
    columns = {"x": "pose.position.x", "y": "pose.position.y"}
    (recording,) = parquet({"columns": BY_TIME["columns"] | columns}, pose=pose)
    np.testing.assert_array_equal(recording.position, [[i, 2.0] for i in range(6)])
    with pytest.raises(
        RecordingError, match=r"no column 'pose\.z', .* it has t, id, x, y, pose, po"
    ):
        parquet({"columns": BY_TIME["columns"] | {"x": "pose.z"}}, pose=pose)


def test_identities_of_parquet_may_be_bytes_and_its_rows_are_whole_numbers(parquet):
    uuid = bytes(range(0xF0, 0x100))
    (recording,) = parquet(BY_TIME, id=[uuid] * 6)
    np.testing.assert_array_equal(recording.key, keys_from_texts([uuid.hex()]))
    (recording,) = parquet(BY_TIME, id=[b"car"] * 6)
    np.testing.assert_array_equal(recording.key, keys_from_texts(["car"]))
    with pytest.raises(RecordingError, match="row 4: the road user has no name"):
        parquet(BY_TIME, id=[1.0, 1.0, 1.0, np.nan, 1.0, 1.0])


def test_the_name_of_a_recording_in_a_column_is_no_path(read):
    text = "f,id,x,y,r\n1,1,0,0,/../../b\n1,1,0,0,c\n"
    columns = {"columns": {**POSITIONS["columns"], "recording": "r"}, "frame_rate": 10}
    assert [recording.name for recording in read(text, columns)] == ["a-_.._.._b", "a-c"]


def test_rows_without_a_position_are_no_observations(read, caplog):
    text = "f,id,x,y\n0,1,0,0\n1,1,,5\n2,1,nan,\n,,,\n4,1,4,0\n"
    (recording,) = read(text, POSITIONS)
    assert recording.frame.tolist() == [0, 4]
    (sentence,) = [record.getMessage() for record in caplog.records]
    assert "a.csv: 3 row(s) without a position ('x' or 'y')" in sentence
    assert sentence.endswith("the first is line 3")


def test_rows_without_a_position_tell_the_rate(read):
    columns = {"track": "id", "time": "t", "x": "x", "y": "y"}
    (by_frame,) = read("f,id,x,y\n0,1,0,0\n1,1,,\n2,1,2,0\n", POSITIONS)
    (by_time,) = read("t,id,x,y\n5.0,1,0,0\n5.1,1,,\n5.2,1,2,0\n", {"columns": columns})
    for recording in (by_frame, by_time):
        assert (recording.frame.tolist(), recording.frame_rate) == ([0, 2], 10.0)


def test_errors_behind_rows_without_a_position_name_their_line(read):
    text = "f,id,x,y\n0,1,0,0\n1,1,,\n"
    with pytest.raises(RecordingError, match=r"a\.csv, line 4, column 'f': '2\.5', expected a wh"):
        read(f"{text}2.5,1,2,2\n", POSITIONS)
    with pytest.raises(RecordingError, match=r"a\.csv, line 5: track 1 has a second row for"):
        read(f"{text}2,1,2,2\n2,1,2,3\n", POSITIONS)
    with pytest.raises(RecordingError, match=r"a\.csv, line 4, column 'y': 'inf', expected a fin"):
        read(f"{text}2,1,2,inf\n", POSITIONS)


def test_a_table_without_any_position_is_refused(read):
    sentence = r"a\.csv has no position: the columns 'x' or 'y' are empty in all of its 2 rows"
    with pytest.raises(RecordingError, match=sentence):
        read("f,id,x,y\n0,1,,\n1,1,2,\n", POSITIONS)


def test_parquet_and_names_in_capitals(read, tmp_path, caplog):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    (tmp_path / "data").mkdir()
    table = pandas.DataFrame(
        {"f": pandas.array([0, None, 2], dtype="Int64"), "id": 1, "x": [0.0, None, 2.0], "y": 1.0}
    )
    table.to_parquet(tmp_path / "data" / "B.PARQUET")
    packed, plain = read(gzip.compress(ROWS.encode()), POSITIONS, "A.CSV.GZ")
    assert (packed.name, len(packed)) == ("A", 10)
    assert (plain.name, plain.frame.tolist()) == ("B", [0, 1])
    assert "B.PARQUET: 1 row(s) without a position ('x' or 'y')" in caplog.text
    assert "the first is row 2" in caplog.text


def test_a_text_of_parquet_that_is_no_unicode_is_one_sentence(read, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    (tmp_path / "data").mkdir()
    places = np.array([0, 1, 2], dtype=np.int32)
    odd = pyarrow.Array.from_buffers(
        pyarrow.string(), 2, [None, pyarrow.py_buffer(places), pyarrow.py_buffer(b"a\xa2")]
    )
    table = pyarrow.table({"id": odd, "f": [0, 1], "x": [0.0, 1.0], "y": [0.0, 1.0]})
    parquet.write_table(table, tmp_path / "data" / "b.parquet")
    with pytest.raises(RecordingError, match=r"b\.parquet cannot be read as Parquet: .*UTF8"):
        read(ROWS, POSITIONS)


def test_rows_closer_than_any_frame_are_called_so(read):
    columns = {"columns": BY_TIME["columns"], "time_unit": "ns"}
    text = "t,id,x,y\n" + "".join(f"{100 * i},1,{i},0\n" for i in range(5))
    sentence = r"line 3: track 1 has rows 1e-07 s apart, expected at least 0\.001 s; is the unit"
    with pytest.raises(RecordingError, match=sentence):
        read(text, columns)


def test_the_recordings_of_a_file_are_found_by_their_names(read, tmp_path):
    text = "t,id,x,y,run\n0,1,0,0,p\n1,1,1,0,p\n0,1,5,0,q\n1,1,6,0,q\n"
    read(text, RUNS)
    options = ReadingOptions(columns=tmp_path / "columns.yaml")
    for names in (["a-q"], ["a-p", "a-q"], ["a-q", "a-p@0-1s"]):
        found = load_recordings(tmp_path / "data", "table", names, options)
        assert sorted(r.name for r in found) == sorted(names)
        assert [len(r) for r in found] == [2] * len(names)
    with pytest.raises(RecordingError, match="has no recording 'a-z', it has a-p, a-q"):
        load_recordings(tmp_path / "data", "table", ["a-z"], options)
    with pytest.raises(RecordingError, match="has no recording 'b-q', it has a"):
        load_recordings(tmp_path / "data", "table", ["b-q"], options)


def test_recordings_that_would_have_one_name_are_refused(read):
    text = "t,id,x,y,run\n0,1,0,0,p/q\n1,1,1,0,p_q\n"
    with pytest.raises(RecordingError, match="has the recordings 'p/q' and 'p_q', expected"):
        read(text, RUNS)


def test_tables_of_another_kind_beside_them_are_passed_over(read, tmp_path, caplog):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "readme.txt").write_text("Hello\n")
    (tmp_path / "data" / "~$a.csv").write_text("x")
    assert [r.name for r in read(ROWS, POSITIONS)] == ["a"]
    assert "readme.txt is passed over" in caplog.text
    with pytest.raises(RecordingError, match=r"readme\.txt has no column 'x'"):
        load_recordings(
            tmp_path / "data", "table", ["readme"], ReadingOptions(tmp_path / "columns.yaml")
        )


COMMAS = POSITIONS | {"separator": ";", "decimal": ",", "thousands": "."}
WITH_COMMAS = ROWS.replace(",", ";").replace(";-2\n", ";-1.002,5\n")


def test_the_cell_that_is_no_number_is_named_among_decimal_commas(read):
    with pytest.raises(RecordingError, match="line 4, column 'y': 'lost', expected a number"):
        read(WITH_COMMAS.replace("2;2;22;-1.002,5", "2;2;22;lost"), COMMAS)
    (recording,) = read(WITH_COMMAS + "Total;x;;\n", COMMAS)  # leaves all columns as text
    assert recording.position[0].tolist() == [20.0, -1002.5]


def test_umlauts_of_one_character_and_of_two_are_the_same(read, parquet):
    one, two = "Z\N{LATIN SMALL LETTER A WITH DIAERESIS}hler", "Za\N{COMBINING DIAERESIS}hler"
    for name, column in ((one, two), (two, one)):
        description = {"columns": POSITIONS["columns"] | {"track": name}, "frame_rate": 10}
        (recording,) = read(ROWS.replace("f,id", f"f,{column}"), description)
        assert recording.track_id.tolist() == [2, 10]
    for name, column in ((one, two), (two, one)):
        read.__closure__[0].cell_contents.joinpath("data", "a.csv").unlink(missing_ok=True)
        assert parquet({"columns": BY_TIME["columns"] | {"track": name}}, **{column: 3})


def test_a_column_of_lists_is_one_sentence(parquet):
    sentence = r"b\.parquet, column 'x': list<element: double>, expected one number, date or text"
    with pytest.raises(RecordingError, match=sentence):
        parquet(BY_TIME, x=[[1.0, 2.0]] * 6)


def test_identities_of_unprintable_bytes_are_digits(parquet):
    (recording,) = parquet(BY_TIME, id=[b"\n" * 16] * 6)
    np.testing.assert_array_equal(recording.key, keys_from_texts(["0a" * 16]))
    with pytest.raises(RecordingError, match="row 1: the road user has no name"):
        parquet(BY_TIME, id=[None, *[b"\xff\xfe"] * 5])


def test_a_column_that_is_twice_in_a_parquet_file_is_refused(read, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    arrays = [pyarrow.array([0.0, 1.0])] * 5
    (tmp_path / "data").mkdir()
    table = pyarrow.Table.from_arrays(arrays, names=["f", "id", "x", "x", "y"])
    parquet.write_table(table, tmp_path / "data" / "b.parquet")
    with pytest.raises(RecordingError, match=r"b\.parquet has 2 columns 'x', expected one"):
        read(ROWS, POSITIONS)
    parquet.write_table(pyarrow.table({}), tmp_path / "data" / "b.parquet")
    options = ReadingOptions(columns=tmp_path / "columns.yaml")
    with pytest.raises(RecordingError, match=r"no column 'id', .*; it has none$"):
        load_recordings(tmp_path / "data", "table", ["b"], options)


@pytest.mark.parametrize("mark", ["'", " ", "\N{NARROW NO-BREAK SPACE}"])
def test_groups_of_digits_have_the_marks_of_any_language(read, mark):
    text = ROWS.replace(",-2\n", f",-1{mark}002.5\n")
    (recording,) = read(text, POSITIONS | {"thousands": mark})
    assert recording.position[0].tolist() == [20.0, -1002.5]


def test_dates_may_have_a_decimal_comma(read):
    rows = "".join(f'"2024-05-01 12:00:00,{n}00",1,{n},0\n' for n in range(5))
    (recording,) = read("t,id,x,y\n" + rows, {**BY_TIME, "time_unit": "date"})
    assert (recording.frame_rate, recording.frame.tolist()) == (10.0, [0, 1, 2, 3, 4])
    assert recording.start_time_ns == 1_714_564_800 * 10**9


def test_numbers_of_road_users_and_classes_may_have_a_decimal_comma(read):
    rows = "".join(f"{f};{i},0;{f},5;0;2,0\n" for i in (2, 10) for f in range(3))
    columns = {**POSITIONS["columns"], "class": "c"}
    description = {**POSITIONS, "columns": columns, "separator": ";", "decimal": ","}
    (recording,) = read("f;id;x;y;c\n" + rows, description)
    assert recording.track_id.tolist() == [2, 10]
    assert recording.agent_class.tolist() == [2, 2]
    (recording,) = read("f;id;x;y;c\n" + rows.replace("10,0;", "1,05;"), description)
    assert recording.find_tracks(keys_from_texts(["1,05"])) >= 0


TIMED = {"columns": {"track": "id", "time": "t", "x": "x", "y": "y"}}


def over_midnight(written=lambda s: f"{s:.1f}", by_track=False):
    """Ten seconds before and after midnight at 10 Hz; road user 2 comes after it."""
    rows = [
        f"{track},{written((86390 + k / 10) % 86400)},{k + 10 * track},{track}"
        for k in range(200)
        for track in (0, 1, 2)
        if track < 2 or k > 150
    ]
    return "id,t,x,y\n" + "\n".join(sorted(rows, key=lambda r: r[0]) if by_track else rows) + "\n"


def as_clock(seconds):
    return f"{seconds // 3600:02.0f}:{seconds % 3600 // 60:02.0f}:{seconds % 60:04.1f}"


@pytest.mark.parametrize("by_track", [False, True])
@pytest.mark.parametrize(
    ("unit", "written"),
    [("s", lambda s: f"{s:.1f}"), ("ms", lambda s: f"{1e3 * s:.0f}"), ("date", as_clock)],
    ids=["s", "ms", "clock"],
)
def test_times_of_day_go_on_at_midnight(read, caplog, unit, written, by_track):
    text = over_midnight(written, by_track)
    (recording,) = read(text, {**TIMED, "time_unit": unit})
    assert (recording.frame_rate, recording.duration_s) == (10.0, pytest.approx(19.9))
    assert len(recording) == 2 * 200 + 49
    np.testing.assert_allclose(recording.position[recording.track == 0, 0], np.arange(200.0))
    (record,) = caplog.records
    assert "a.csv: the times begin again at 0 after 86400 s, as times of day do at midnight" in (
        record.getMessage()
    )


@pytest.mark.parametrize(
    "times",
    [
        [0.0, 0.1, 86000.0, 86000.1],  # a pause of minutes at midnight
        [0.0, 0.1, 86399.9, 86400.1],  # not within a day
        [0.0, 40000.0, 80000.0, 86399.9],  # all the day
    ],
    ids=str,
)
def test_other_times_do_not_go_on_at_midnight(read, times):
    text = "id,t,x,y\n" + "".join(f"1,{t},{t / 100},0\n" for t in times)
    (recording,) = read(text, TIMED)
    assert recording.duration_s == pytest.approx(times[-1] - times[0])


def test_road_users_of_two_ends_of_a_day_are_not_joined(read):
    text = "id,t,x,y\n1,0.0,0,0\n1,0.1,1,0\n2,86399.8,0,0\n2,86399.9,0,0\n"
    (recording,) = read(text, TIMED)
    assert recording.duration_s == pytest.approx(86399.9)


@pytest.mark.parametrize("time", ["1:2", "24:00:00", "12:00:60", "12:00", "12:00:00 PM", ""])
def test_other_texts_are_no_times_of_day(read, time):
    text = f"t,id,x,y\n12:00:00,1,1,1\n{time},1,1,1\n"
    with pytest.raises(RecordingError, match="expected a date and time such as"):
        read(text, {**TIMED, "time_unit": "date"})


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    ("line", "text"),
    [
        (1, 'f,id,x,"y\n' + ROWS.partition("\n")[2]),
        (4, ROWS.replace("2,2,22,", '2,2,22,"')),
        (5, "\n" + ROWS.replace("2,2,22,", '2,2,22,"')),
        (12, ROWS + '5,2,25,"'),
        (6, ROWS.replace("0,2,20,-2", '0,2,20,"\n-2"').replace("3,2,23", '3,2,"23')),
        (4, ROWS.replace("2,2,22,", '2,2,22,"') + "x" * 200_000),
    ],
)  # fmt: skip
def test_a_quote_that_is_not_closed_is_named_by_its_line(read, line, text, compressed):
    data, name = (gzip.compress(text.encode()), "a.csv.gz") if compressed else (text, "a.csv")
    with pytest.raises(RecordingError, match=rf"a\.csv.*, line {line}: a quote opens here"):
        read(data, POSITIONS, name)


def test_a_cell_of_many_lines_is_shown_in_part_and_a_missing_quote_suspected(read):
    text = ROWS.replace("2,2,22,-2", '2,2,22,"-2').replace("0,10,100,-10", '0,10,100,-10"')
    with pytest.raises(RecordingError, match="in one line: is a quote missing") as refused:
        read(text + ROWS.partition("\n")[2].replace(",2,", ",3,") * 20, POSITIONS)
    assert "line 4, column 'y'" in str(refused.value)
    assert len(str(refused.value)) < 300


def test_local_times_that_go_back_when_summer_time_ends_are_named(read, caplog):
    clock = [f"2023-10-29T02:59:5{k}.0" for k in range(10)]
    clock += [f"2023-10-29T02:00:0{k}.0" for k in range(10)]
    text = "t,id,x,y\n" + "".join(f"{t},1,{k},0\n" for k, t in enumerate(clock))
    read(text, {**TIMED, "time_unit": "date"})
    assert "a.csv, line 12: the dates go back by an hour, as local times do when" in caplog.text
    caplog.clear()
    zoned = text.replace(":59:5", ":59:5").replace(".0,", "+02:00,")
    for k in range(10):
        zoned = zoned.replace(f"02:00:0{k}+02:00", f"02:00:0{k}+01:00")
    (recording,) = read(zoned, {**TIMED, "time_unit": "date"})
    assert recording.duration_s == 19.0
    assert "go back" not in caplog.text


@pytest.mark.parametrize("time", ["2023-10-29T02:59:50.0", "02:59:50", "2023-10-29"])
def test_a_date_in_place_of_a_number_is_told_what_it_needs(read, time):
    with pytest.raises(RecordingError, match="need time_unit: date"):
        read(f"t,id,x,y\n{time},1,1,1\n", TIMED)


def test_a_folder_named_as_a_file_and_a_link_to_nothing_are_named_once(tmp_path):
    (tmp_path / "columns.yaml").write_text(yaml.safe_dump(TIMED))
    options = ReadingOptions(columns=tmp_path / "columns.yaml")
    for name, make, reason in (
        ("a.csv", lambda path: path.mkdir(), "Is a directory"),
        ("b.csv", lambda path: path.symlink_to("nothing"), "No such file or directory"),
    ):
        (folder := tmp_path / f"folder {name}").mkdir()
        make(folder / name)
        with pytest.raises(RecordingError) as refused:
            load_recordings(folder, "table", options=options)
        assert str(refused.value) == f"{folder / name} cannot be read as CSV: {reason}"


@pytest.mark.parametrize("cell", ["1,5", "0,123", "12,3456", "1234,567"])
def test_a_decimal_mark_that_is_given_as_that_of_thousands_is_refused(read, cell):
    text = f't,id,x,y\n0,1,"1,000",0\n1,1,"{cell}",0\n'
    description = {"columns": {"track": "id", "time": "t", "x": "x", "y": "y"}, "thousands": ","}
    expected = rf"line 3, column 'x': '{cell}', expected ',' between groups of three digits; is it"
    with pytest.raises(RecordingError, match=expected):
        read(text, description)


@pytest.mark.parametrize("cell", ["1,234.5", "-1,234,567", "12,34,567.25", "7.25", "700"])
def test_groups_of_digits_are_read(read, cell):
    text = f't,id,x,y\n0,1,"{cell}",0\n'
    description = {"columns": {"track": "id", "time": "t", "x": "x", "y": "y"}, "thousands": ","}
    (recording,) = read(text, description)
    assert recording.position[0, 0] == float(cell.replace(",", ""))


def test_leading_zeros_tell_two_road_users_apart(read):
    rows = [(f, track) for f in range(3) for track in ("1", "01", "2")]
    text = "f,id,x,y\n" + "".join(f"{f},{track},{f},{len(track)}\n" for f, track in rows)
    (recording,) = read(text, POSITIONS)
    assert len(recording.track_id) == 3
    assert recording.find_tracks(keys_from_texts(["01", "1", "2"])).tolist() == [0, 1, 2]
    # Where each number is written in one way it is a number.
    (recording,) = read(text.replace(",1,", ",10,").replace(",01,", ",09,"), POSITIONS)
    assert recording.track_id.tolist() == [2, 9, 10]


def test_rows_that_the_history_leaves_out_are_counted(read, caplog):
    text = "f,id,x,y,u,v\n" + "".join(
        f"{f},1,{f},0,{-9999 if f % 2 else 10},0\n" for f in range(6)
    )
    columns = {**POSITIONS["columns"], "vx": "u", "vy": "v"}
    (recording,) = read(text, {**POSITIONS, "columns": columns})
    assert len(recording) == 6
    (record,) = caplog.records
    assert record.getMessage() == "mtpgo: table a: 3 objects faster than possible"
