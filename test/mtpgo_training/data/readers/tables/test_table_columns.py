# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The description of columns that the documentation shows."""

import re
from pathlib import Path

import pytest

from mtpgo_core.class_map import read_class_map
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers.tables.table_columns import read_columns

DOCS = Path(__file__).resolve().parents[5] / "docs"


def yaml_block(page, beginning):
    blocks = re.findall(r"```yaml\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)
    (block,) = [block for block in blocks if block.startswith(beginning)]
    return block


def test_the_example_in_the_docs_is_valid_with_all_its_comments(tmp_path):
    path = tmp_path / "columns.yaml"
    block = yaml_block("recordings.md", "columns:")
    path.write_text(block)
    columns = read_columns(path)
    assert columns.columns.given() == {
        "track": "id", "time": "t", "x": "px", "y": "py", "agent_class": "kind",
    }  # fmt: skip
    # What is commented out is allowed as well.
    lines = re.sub(r"^# (?=\w+: )", "", block, flags=re.MULTILINE).replace(
        "  time: t", "  frame: t"
    )
    path.write_text(lines.replace('decimal: ","', "decimal: '.'").replace('"."', '"_"'))
    columns = read_columns(path)
    assert (columns.frame_rate, columns.separator, columns.location) == (
        25,
        ";",
        "name of the site",
    )
    assert columns.names == ("frame", "id", "x", "y")


def test_the_class_map_in_the_docs_is_valid(tmp_path):
    path = tmp_path / "classes.yaml"
    path.write_text(yaml_block("messages.md", "preset:"))
    names = ["tram", "17", "vehicle.car", "traffic cone"]
    assert read_class_map(path).find_all(names).tolist() == [
        AgentClass.BUS, AgentClass.PEDESTRIAN, AgentClass.CAR, AgentClass.UNKNOWN,
    ]  # fmt: skip


def columns_of(tmp_path, text):
    (tmp_path / "columns.yaml").write_text(text)
    return read_columns(tmp_path / "columns.yaml")


def test_names_of_columns_are_read_as_they_are_written(tmp_path):
    text = "columns: {track: no, frame: 01, x: on, y: 1e3}\nnames: [no, 01, on, 1e3]\n"
    columns = columns_of(tmp_path, text + "frame_rate: 10\n")
    assert columns.columns.given() == {"track": "no", "frame": "01", "x": "on", "y": "1e3"}
    assert columns.names == ("no", "01", "on", "1e3")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "columns:\n  x: a\n  x: b\n",
            "line 3 cannot be read as YAML: the key 'x' is given a second time",
        ),
        ("columns:\n  x: [a, b]\n", "line 2: columns.x is a list or mapping, expected one col"),
        (
            "columns: {track: i, time: t, x: x, y: y}\nnames: [i, t, x, y, x]\n",
            "names has 'x' more than once",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, sentence):
    with pytest.raises(ConfigurationError, match=sentence) as caught:
        columns_of(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "columns.yaml"))
