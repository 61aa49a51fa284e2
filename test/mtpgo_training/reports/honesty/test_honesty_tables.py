# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of honesty, from known paths."""

import copy

import pytest
from known_paths import honest_content
from known_scores import json_content

from mtpgo_training.reports.honesty.honesty_tables import (
    comparison_table,
    coverage_table,
    headline_table,
    honesty_tables,
    jump_text,
    paths_table,
    split_tables,
    weights_table,
)
from mtpgo_training.table_format import to_html, to_text


@pytest.fixture(scope="module")
def content():
    return honest_content()


def cell(table, row, head):
    (found,) = (r for r in table.rows if r.name == row)
    return found.cells[list(table.heads).index(head) - 1]


def test_the_headline_is_of_moving_road_users(content):
    table = headline_table(content)
    assert [row.name for row in table.rows] == ["m", "cv"]
    # 3 m off with a standard deviation of 1 m; the lighter mode is right.
    assert cell(table, "m", "5 s") == "0.000 (1.000)"
    assert cell(table, "m", "sigma/RMSE 1 s") == "0.47"
    assert cell(table, "m", "agents") == "12"


def test_every_table_has_as_many_cells_as_heads(content):
    tables = honesty_tables(content)
    assert len(tables) == 8
    for table in (*tables, headline_table(content)):
        assert all(len(row.cells) + 1 == len(table.heads) for row in table.rows), table.heads
        assert "nan" not in to_text(table).lower()
        cells = sum(len(row.cells) + 1 for row in table.rows)
        assert to_html(table).count("<td") == cells


def test_groups_that_are_never_seen_at_the_last_time_have_a_row(content):
    """As those of models with a shorter horizon."""
    shorter = copy.deepcopy(content)
    for groups in shorter["honesty"]["m"]["all"].values():
        for values in groups.values() if "nll" not in groups else [groups]:
            for key in ("nll", "ellipse_90", "region_90"):
                values[key][2] = None
            for key in ("sigma", "rmse", "ratio"):
                values["spread"][key][4] = None
    before, after = (
        next(t for t in honesty_tables(c) if t.heading == "Coverage by class and motion")
        for c in (content, shorter)
    )
    assert [row.name for row in after.rows] == [row.name for row in before.rows]
    name = next(row.name for row in after.rows if row.name.endswith(": m"))
    for head in ("90% 1s", "90% 3s"):
        assert cell(after, name, head) == cell(before, name, head)
    assert (cell(after, name, "90% 5s"), cell(after, name, "ratio 5s")) == ("-", "-")


def test_coverage_weights_and_paths_are_split_by_class_and_by_speed(content):
    tables = {table.heading: table for table in split_tables(content)}
    kinds = ("Coverage and sharpness", "Weights of the modes", "Plausibility")
    assert list(tables) == [
        f"{kind} {by}" for by in ("by class and motion", "by speed (m/s)") for kind in kinds
    ]
    for table in tables.values():
        assert all(len(row.cells) + 1 == len(table.heads) for row in table.rows), table.heads
    coverage, weights, plausible = (tables[f"{kind} by class and motion"] for kind in kinds)
    assert {f"{percent}% {t}s" for percent in (50, 90, 95) for t in (1, 3, 5)} < {*coverage.heads}
    # Cars and pedestrians are predicted alike: 3 m off with a standard deviation of 1 m.
    for group, agents in (("car, moving", "12"), ("pedestrian, standing", "8")):
        assert cell(coverage, f"{group}: m", "90% 5s") == "0.000 (1.000)"
        assert cell(coverage, f"{group}: m", "agents") == agents
        assert cell(weights, f"{group}: m", "nearest (chance)") == "0.000 (0.500)"
        assert cell(plausible, f"{group}: cv", "jump m (95 %)") == "0.50 (0.50)"
    assert cell(plausible, "car, moving: m", "reverses") == "0.0 %"
    assert cell(plausible, "pedestrian, standing: m", "reverses") == "-"
    slow = tables["Coverage and sharpness by speed (m/s)"]
    assert [row.name for row in slow.rows] == ["0-1: m", "0-1: cv", "5-15: m", "5-15: cv"]


def test_a_single_group_is_named_in_the_head():
    content = copy.deepcopy(honest_content())
    for protocols in content["honesty"].values():
        protocols["all"]["by_speed"].pop("0-1")
    heads = [table.heads[0] for table in split_tables(content)[3:]]
    assert heads == ["5-15", "weights, 5-15", "paths, 5-15"]


def test_a_value_that_is_not_defined_is_a_dash(content):
    table = paths_table(content)
    assert cell(table, "cv", "jump m (95 %)") == cell(table, "cv", "mixture") == "0.50 (0.50)"
    assert cell(table, "cv", "creep m") == "-"
    assert cell(table, "cv", "reverses") == "0.0 %"
    assert cell(table, "cv", "lateral > 4 (truth)") == "0.0 % (0.0 %)"
    assert [row.name for row in weights_table(content, ("moving", "standing")).rows] == [
        "moving: m",
        "standing: m",
    ]


def test_motions_that_do_not_occur_have_no_rows(content):
    names = [row.name for row in coverage_table(content, ("moving", "unknown")).rows]
    assert names == ["moving: m", "moving: cv"]


def test_a_model_that_is_worse_than_simple_motion_is_marked(content):
    table = comparison_table(content)
    assert cell(table, "car, moving: m", "> 2 % worse") == "worse"
    assert cell(table, "car, moving: m", "/ cv") == "4.00"
    assert cell(table, "car, moving: m", "ca") == "-"


def test_jumps_of_standing_road_users_have_a_column():
    content = copy.deepcopy(honest_content())
    standing = content["honesty"]["cv"]["all"]["by_motion"]["standing"]
    standing["consistency"] |= {"jump": 0.25, "jump_95": 1.0}
    table = paths_table(content)
    assert cell(table, "cv", "standing") == "0.25 (1.00)"
    assert cell(table, "cv", "jump m (95 %)") == "0.50 (0.50)"
    del content["honesty"]["cv"]["all"]["by_motion"]["standing"]
    assert cell(paths_table(content), "cv", "standing") == "-"
    assert "standing: the jump of standing road users" in table.text


def test_the_text_says_over_which_time_jumps_are(content):
    assert "0.2 s later" in jump_text(content)
    assert jump_text({**content, "honesty": {}}).startswith("Jumps are not available")


def test_results_without_honesty_have_the_pooled_coverage_only():
    content = json_content()
    assert headline_table(content) is None
    assert [table.heading for table in honesty_tables(content)] == ["Coverage, pooled"]
    assert split_tables(content) == []
