# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command ``mtpgo convert``: damaged bags become whole ones."""

import pytest
from fleet import write_bag
from odd_bags import OddBag, bytes_of, states_at
from rosbags.highlevel import AnyReader
from traffic import braking_cars

from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_training import cli

LENGTH = 300
TEXT = b"\0\1\0\0" + (LENGTH + 1).to_bytes(4, "little") + LENGTH * b"x" + b"\0"


@pytest.fixture
def cut(tmp_path):
    path = tmp_path / "cut.mcap"
    with McapWriter(path) as bag:
        bag.add_topic("/x", "std_msgs/msg/String")
        for number in range(100):
            bag.write_bytes("/x", number * 10**8, TEXT)
    path.write_bytes(path.read_bytes()[:10_000])
    return path


def test_a_bag_is_copied_as_it_is_and_the_loss_stated(cut, tmp_path, capsys, caplog):
    assert cli.main(["convert", "bag", str(cut), "--raw", "-o", str(tmp_path / "whole")]) == 0
    with AnyReader([tmp_path / "whole"]) as reader:
        count = reader.message_count
        assert 10 < count < 100
        texts = [reader.deserialize(data, c.msgtype).data for c, _, data in reader.messages()]
    assert texts == count * [LENGTH * "x"]
    assert capsys.readouterr().out == (
        f"{tmp_path / 'whole'}: 1 topic(s), {(count - 1) / 10:.1f} s, {count} messages\n"
    )
    (sentence,) = [r.getMessage() for r in caplog.records]
    assert f"about {100 - count} messages ({(100 - count) / 10:.1f} s) lost" in sentence


@pytest.mark.parametrize(
    ("layout", "more", "words"),
    [
        ("ind", [], "--raw is given with the layout 'ind', expected 'bag'"),
        ("bag", ["--join"], "--join is given with --raw"),
        ("bag", ["--topic", "/x"], "--topic is given with --raw"),
        ("bag", ["--ego", "3"], "--ego is given with --raw"),
    ],
)
def test_what_does_not_go_together_is_named(cut, tmp_path, capsys, layout, more, words):
    out = str(tmp_path / "whole")
    assert cli.main(["convert", layout, str(cut), "--raw", "-o", out, *more]) == 2
    assert words in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["cut.mcap"]


@pytest.mark.parametrize(
    ("span", "words"),
    [
        (["--start", "nan"], "--start is nan, expected at least 0 s"),
        (["--start", "-1"], "--start is -1.0, expected at least 0 s"),
        (["--start", "5", "--end", "1"], "--end is 1.0, expected more than the start, 5 s"),
        (["--end", "0"], "--end is 0.0, expected more than the start, 0 s"),
    ],
)
def test_a_part_that_is_none_is_refused(tmp_path, capsys, span, words):
    command = ["convert", "ind", str(tmp_path), "-o", str(tmp_path / "bag"), *span]
    assert cli.main(command) == 2
    assert words in capsys.readouterr().err


def test_a_bag_is_not_converted_onto_itself(tmp_path, capsys):
    path = write_bag(tmp_path / "drive", braking_cars(seconds=2.0))
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    for output in (path, *path.glob("*.mcap")):
        assert cli.main(["convert", "bag", str(path), "-o", str(output)]) == 2
        assert "which is read, expected another output" in capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in path.iterdir()} == before


def test_topics_that_are_copied_in_part_are_not_called_left_out(tmp_path, capsys):
    with OddBag(tmp_path / "a.mcap") as bag:
        bag.add(bag.objects(), bytes_of(states_at(0.0)), 0.0)
        for topic in ("/objects", "/scene"):
            other = bag.channel(topic, "a.B", "{}", language="jsonschema", encoding="json")
            bag.add(other, b"{}", 1.0)
    out = str(tmp_path / "out")
    assert cli.main(["convert", "bag", str(tmp_path / "a.mcap"), "--raw", "-o", out]) == 0
    assert sorted(capsys.readouterr().err.splitlines()) == [
        "mtpgo: topic /objects is copied in part: its 1 messages in 'json' are left out",
        "mtpgo: topic /scene is left out: its messages are encoded as 'json', expected 'cdr'",
    ]
