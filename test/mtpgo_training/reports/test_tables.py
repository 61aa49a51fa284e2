# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest
from known_paths import honest_content
from known_scores import json_content

from mtpgo_training.reports.tables import (
    agreement_table,
    group_tables,
    nees_table,
    result_tables,
)
from mtpgo_training.table_format import Cell


@pytest.fixture(scope="module")
def content():
    return json_content()


def test_the_best_of_each_column_is_marked(content):
    results, seeds = result_tables(content)
    rows = {row.name: row for row in results.rows}
    assert list(rows) == ["x-seed1", "x-seed2", "cv"]
    ade = results.heads.index("ADE m") - 1
    assert [row.cells[ade].best for row in rows.values()] == [True, False, False]
    assert rows["x-seed1"].cells[ade] == Cell("1.250", "1.00 to 1.50", best=True)
    assert content["models"]["x-seed1"]["all"]["ade"] == pytest.approx(1.25)
    assert rows["x-seed1"].cells[-1].text == "0.25"
    assert rows["cv"].baseline
    assert seeds.rows[0].cells[0].text == "1.875"


def test_groups_have_a_line_for_each_model(content):
    tables = {table.heading: table for table in group_tables(content)}
    assert set(tables) == {"By manoeuvre", "By class", "By recording"}
    names = [row.name for row in tables["By manoeuvre"].rows]
    assert names == ["lane keep: x-seed1", "lane keep: x-seed2", "lane keep: cv"]
    values = [row.cells[0] for row in tables["By recording"].rows]
    assert values[:3] == ["1.00", "2.00", "4.00"]
    assert agreement_table(content) is None


def test_the_time_since_the_start_has_a_table_where_it_is_known():
    heading = "By time since the recording's start"
    (table,) = [one for one in group_tables(honest_content()) if one.heading == heading]
    assert [row.name for row in table.rows] == ["moving, 0-20 s: m", "moving, 0-20 s: cv"]


def test_a_mixture_without_nees_is_no_number():
    steps = {"nees": [1.0, 2.0], "nees_mixture": [1.0, None], "time_s": [1.0, 2.0]}
    (row,) = nees_table({"by_horizon": {"a": {"all": steps}}}).rows
    assert "1.00 (1.00)" in row.cells
    assert "-" in row.cells
