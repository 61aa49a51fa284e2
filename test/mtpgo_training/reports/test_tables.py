# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest
from known_scores import add

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.evaluation.scores.bootstrap import over_groups
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.reports.figures import draw_figures
from mtpgo_training.reports.markdown import markdown_table, read_results
from mtpgo_training.reports.page import prepare_folder
from mtpgo_training.reports.series import colour
from mtpgo_training.reports.tables import agreement_table, group_tables, result_tables
from mtpgo_training.table_format import Cell


@pytest.fixture(scope="module")
def content():
    """Two seeds of one model and constant velocity, 1, 2 and 4 m off, on two recordings."""
    table = ScoreTable()
    for model, error in (("x-seed1", 1.0), ("x-seed2", 2.0), ("cv", 4.0)):
        for recording, factor in (("01", 1.0), ("02", 1.5)):
            spread = None if model == "cv" else 1.0
            add(table, error * factor, recording, model, n=3, spread=spread)
    models = table.averages()
    return {
        "models": models,
        **breakdowns(table),
        "baselines": ["cv", "ca", "ctrv"],
        "seeds": over_groups(models, {"x": ["x-seed1", "x-seed2"]}),
        "recordings": {"01": "a", "02": "b"},
        "agreement": {},
        "warnings": ["x-seed1 was trained on 01"],
    }


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


def test_figures_have_one_colour_for_each_model(content, tmp_path):
    paths = draw_figures(content, tmp_path)
    assert set(paths) == {"horizon", "reliability", "nees", "manoeuvres"}
    assert len({colour(content, name) for name in content["models"]}) == 3
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.png" for name in paths}


def test_markdown_has_values_intervals_and_warnings(content):
    lines = markdown_table([("", content)]).splitlines()
    assert lines[0].startswith("| protocol | model | ADE m |")
    assert lines[2].startswith("| all | x-seed1 | 1.25 (1.00 to 1.50) |")
    assert lines[-1] == "- Note: x-seed1 was trained on 01."
    assert len({line.count("|") for line in lines[:5]}) == 1


def test_a_file_without_results_is_refused(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("[1]")
    with pytest.raises(RecordingError, match="holds no results"):
        read_results(path)


def test_the_folder_is_created_or_refused(tmp_path):
    prepare_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="is a file, expected a folder"):
        prepare_folder(tmp_path / "file")
