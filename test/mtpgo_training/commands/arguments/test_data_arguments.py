# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings on the command line: one grammar for all commands."""

import argparse
from pathlib import Path

import pytest

from msg_adapters.inputs.ego_odometry import EgoOptions
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.data_arguments import (
    add_data_arguments,
    bag_options,
    data_sources,
)
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.reading_layouts import LAYOUTS
from mtpgo_training.data.readers.reading_options import ReadingOptions

A, B, C = Path("a"), Path("b"), Path("c")


def parsed(line, form="--data", default=None, **settings):
    parser = argparse.ArgumentParser()
    parser.add_argument("-o")
    add_data_arguments(parser, form, **settings)
    return data_sources(parser.parse_args(line.split()).data_options, default)


def test_layouts_and_names_belong_to_the_folder_before_them(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    options = [("layout", "ind"), ("data", a), ("data", b), ("recordings", ["3"])]
    sources = data_sources([*options, ("layout", "highd")])
    assert [(s.directory, s.layout, s.names) for s in sources] == [
        (a, "ind", None),
        (b, "highd", ("3",)),
    ]
    assert [s.layout for s in data_sources(options)] == ["ind", "ind"]


def test_one_layout_serves_all_directories():
    layout = next(iter(LAYOUTS))
    for line in (
        f"--data a --data b --layout {layout}",
        f"--layout {layout} --data a --data b",
        f"--data a --layout {layout} --data b",
    ):
        assert parsed(line) == [DataSource(A, layout), DataSource(B, layout)]
    with pytest.raises(ConfigurationError, match="3 times for 2 times"):
        parsed(f"--data a --data b {f'--layout {layout} ' * 3}")


@pytest.mark.parametrize(
    ("line", "layouts"),
    [
        ("--data a --data b --layout ind --layout highd", ["ind", "highd"]),
        ("--data a --layout ind --data b --layout highd", ["ind", "highd"]),
        ("--layout ind --data a --layout highd --data b", ["ind", "highd"]),
        ("--data a --layout ind --data b --data c --layout highd", ["ind", "ind", "highd"]),
        ("--layout ind --data a --data b --layout highd --data c", ["ind", "highd", "highd"]),
    ],
)
def test_layouts_belong_to_directories_in_order(line, layouts):
    assert [source.layout for source in parsed(line)] == layouts


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("--layout ind", "--layout is given without --data"),
        ("--recordings 01", "--recordings is given without --data"),
        ("--data a", "the layout of a is not given, expected --layout with one of highd"),
        ("--data a --data b --layout ind --data c --layout ind", "the layout of a is not given"),
        ("--data a --layout ind --layout ind", "2 times for 1 times"),
    ],
)
def test_a_line_that_is_not_clear_is_refused(line, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        parsed(line)


def test_a_directory_may_be_required(capsys):
    with pytest.raises(SystemExit):
        parsed("--layout ind", required=True)
    assert "--data" in capsys.readouterr().err


def test_recordings_belong_to_the_directory_before_them():
    given = parsed("--recordings 1 --data a --layout ind --data b --recordings 2 3")
    assert given == [DataSource(A, "ind", ("1",)), DataSource(B, "ind", ("2", "3"))]


def test_columns_are_those_of_a_table():
    with pytest.raises(ConfigurationError, match="--columns is given for the layout 'ind', exp"):
        parsed("--data a --layout table --data b --layout ind --columns c.yaml")
    _, second = parsed("--data a --layout ind --columns c.yaml --data b --layout table")
    assert str(second.options.columns) == "c.yaml"


def test_columns_and_class_maps_hold_for_the_directories_after_them():
    given = parsed(
        "--class-map coco --data a --layout table --columns c.yaml --data b --data c "
        "--class-map nuscenes"
    )
    assert [source.options for source in given] == [
        ReadingOptions(Path("c.yaml"), "coco"),
        ReadingOptions(Path("c.yaml"), "coco"),
        ReadingOptions(Path("c.yaml"), "nuscenes"),
    ]
    with pytest.raises(ConfigurationError, match="class map 'kitti' is neither a preset nor a f"):
        parsed("--data a --layout ind --class-map kitti")
    with pytest.raises(ConfigurationError, match="--class-map is given without --data"):
        parsed("--class-map coco")


@pytest.mark.parametrize(
    "line",
    [
        "ind a --recordings 1 2 -o x",
        "-o x ind a --recordings 1 2",
        "ind a -o x --recordings 1 2",
        "ind -o x a --recordings 1 2",
        "--recordings 1 2 -o x ind a",
    ],
)
def test_layout_and_directory_without_options(line):
    assert parsed(line, "LAYOUT DIRECTORY") == [DataSource(A, "ind", ("1", "2"))]


def test_a_directory_without_an_option_and_a_default():
    shipped = DataSource(C, "highd")
    assert parsed("", "[DIR]", shipped) == [shipped]
    assert parsed("--recordings 1", "[DIR]", shipped) == [DataSource(C, "highd", ("1",))]
    assert parsed("--layout highd", "[DIR]", shipped) == [shipped]
    with pytest.raises(ConfigurationError, match="--layout ind is given without a directory of r"):
        parsed("--layout ind", "[DIR]", shipped)
    assert parsed("a --layout ind", "[DIR]", shipped) == [DataSource(A, "ind")]
    both = parsed("a --layout ind --data b --recordings 4", "[DIR]", shipped)
    assert both == [DataSource(A, "ind"), DataSource(B, "ind", ("4",))]
    with pytest.raises(ConfigurationError, match="the layout of a is not given"):
        parsed("a", "[DIR]", shipped)


def test_options_of_bags_belong_to_the_directory_before_them():
    line = (
        "--data a --layout bag --topic /x --data b --topics one=/y two=/z --stamps log "
        "--twist-frame object --data c --layout bag"
    )
    assert [source.options.bags for source in parsed(line)] == [
        BagOptions("/x"),
        BagOptions("", {"one": "/y", "two": "/z"}, "log", "object"),
        BagOptions(),
    ]
    assert parsed("--topic /x bag a", "LAYOUT DIRECTORY")[0].options.bags == BagOptions("/x")
    ego = "--data a --layout bag --ego-topic /odom --ego-box 5.2 2.0 1.4 --ego-class truck"
    assert parsed(ego)[0].options.bags == BagOptions(
        ego_topic="/odom", ego=EgoOptions(5.2, 2.0, "truck", 1.4)
    )
    for line, words in (
        ("--ego-box 5 2", "--ego-box is given without --ego-topic"),
        ("--ego-topic /odom --ego-box 5", "--ego-box has 1 numbers, expected length, width"),
        ("--ego-topic /odom --ego-box 0 2", "ego length_m is 0"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            parsed(f"--data a --layout bag {line}")
    with pytest.raises(ConfigurationError, match="--topics has '/x', expected BAG=TOPIC"):
        parsed("--data a --layout bag --topics /x")
    with pytest.raises(ConfigurationError, match="--recordings is given without --data"):
        bag_options([("topics", ["a=/b"]), ("recordings", ["1"])])


LINES = '{"type": "MultiLineString", "coordinates": [[[0, 2], [90, 2]], [[0, -2], [90, -2]]]}'


def test_a_lane_file_belongs_to_the_directory_before_it(tmp_path):
    path = tmp_path / "lanes.geojson"
    path.write_text(LINES)
    first, second = parsed(f"--data a --lane-file {path} --lane-offset=-1,2 --data b --layout ind")
    assert [line[0].tolist() for line in first.options.lanes.lines] == [[1.0, 0.0], [1.0, -4.0]]
    assert second.options.lanes is None
    assert bag_options([("lane_file", path)]).lanes is not None


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("--lane-file none.osm", "none.osm cannot be read: No such file"),
        ("--lane-origin 49,8", "--lane-origin is given without --lane-file"),
        ("--lane-file none.osm --lane-offset x", "lane_offset is 'x', expected x and y"),
    ],
)
def test_a_lane_file_is_checked_before_anything_is_read(line, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        parsed(f"--data a --layout ind {line}")
