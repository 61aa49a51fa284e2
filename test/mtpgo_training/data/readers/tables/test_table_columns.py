# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The description of columns that the documentation shows."""

import re
from pathlib import Path

from mtpgo_core.class_map import read_class_map
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
