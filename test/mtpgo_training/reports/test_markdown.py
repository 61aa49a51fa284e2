# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Results as Markdown, from known scores."""

import copy

import pytest
from known_scores import json_content

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.reports.markdown import markdown_table, read_results
from mtpgo_training.reports.tables import result_tables


@pytest.fixture(scope="module")
def content():
    return json_content()


def test_markdown_has_values_intervals_and_warnings(content):
    lines = markdown_table([("", content)]).splitlines()
    assert lines[0].startswith("| protocol | model | ADE m |")
    assert lines[2].startswith("| all | x-seed1 | 1.25 (1.00 to 1.50) |")
    assert lines[-1] == "- Note: x-seed1 was trained on 01."
    assert len({line.count("|") for line in lines[:5]}) == 1


def test_likelihoods_by_kernels_have_columns_where_there_are_some(content):
    assert "kde" not in markdown_table([("", content)])
    other = copy.deepcopy(content)
    other["models"]["x-seed1"]["all"] |= {"anll_kde": 1.5, "fnll_kde": 2.5}
    lines = markdown_table([("one", content), ("two", other)]).splitlines()
    assert lines[0].endswith("| ANLL kde | FNLL kde |")
    assert lines[2].endswith("| - | - |")
    assert lines[5].endswith("| 1.50 | 2.50 |")
    results, *_ = result_tables(other)
    assert results.heads[-3:] == ["ANLL kde", "FNLL kde", "ADE / cv"]
    assert [str(cell) for cell in results.rows[0].cells[-3:-1]] == ["1.500", "2.500"]


def test_a_file_without_results_is_refused(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("[1]")
    expected = "holds no results, expected a file of 'mtpgo evaluate --json': it has no 'models'"
    with pytest.raises(ConfigurationError, match=expected):
        read_results(path)


def test_several_results_have_a_column_of_names_and_each_note_once(content):
    other = copy.deepcopy(content)
    other["warnings"].append("x-seed2 was trained on 02")
    lines = markdown_table([("one", content), ("two", other)]).splitlines()
    assert lines[0].startswith("| data | protocol | model |")
    assert [line.split(" | ")[0] for line in lines[2:8]] == ["| one"] * 3 + ["| two"] * 3
    notes = [f"- Note: x-seed{n} was trained on 0{n}." for n in (1, 2)]
    assert lines[8:] == ["", *notes]


def test_what_has_no_interval_is_a_value_alone(content):
    single = {**content, "intervals": {}, "warnings": []}
    cells = markdown_table([("", single)]).splitlines()[2].split(" | ")
    assert cells[:3] == ["| all", "x-seed1", "1.25"]


@pytest.mark.parametrize(
    "text",
    [
        '{"models": [], "intervals": 0, "recordings": 0}',
        '{"models": {"a": 3}, "intervals": {}, "recordings": {}}',
        '{"models": {"a": {"all": {}}}, "intervals": {}, "recordings": {}}',
        '{"models": {"a": {"all": {"ade": "x"}}}, "intervals": {}, "recordings": {}}',
    ],
)
def test_results_of_another_form_are_refused(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=r"a\.json holds no results that can be shown"):
        read_results(path)
