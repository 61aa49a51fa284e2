# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Means over seeds with intervals, gaps and the ranking, from scores worked out by hand."""

import json

import pytest

from mtpgo_training.atomic_files import write_text
from mtpgo_training.study.output.study_output import sections, write_results
from mtpgo_training.study.output.study_tables import (
    gaps,
    main_table,
    ranking_table,
    to_csv,
    to_latex,
)
from mtpgo_training.study.study_folder import StudyFolder
from mtpgo_training.study.study_results import half_width, results
from mtpgo_training.study.study_rows import STUDIES

TRAINING = {
    "parameters": 10,
    "epochs": 2,
    "epochs_done": 2,
    "steps": 4,
    "minutes": 1.0,
    "steps_per_second": 0.1,
}


def write_scores(folder, row, seed, ade, cv=2.0, ca=None):
    values = {"model": {"ade": ade, "anll": -1.0, "anll_kde": -3.0}, "cv": {"ade": cv}}
    values["ca"] = {"ade": ca}
    content = {"row": row, "seed": seed, "training": TRAINING, "values": values, "by_class": {}}
    write_text(folder.run(row, seed).scores, json.dumps(content))


def rows_of(study, *names):
    return study, study.chosen(names)


@pytest.fixture
def content(tmp_path):
    """Three seeds of MTP-GO1, one of Seq2Seq, a failed run and a refused row."""
    folder = StudyFolder(tmp_path)
    for seed, ade in ((1, 0.9), (2, 1.0), (3, 1.1)):
        write_scores(folder, "mtp-go1", seed, ade)
    write_scores(folder, "seq2seq", 1, 2.5)
    folder.run("seq2seq", 2).write_error(ValueError("no GPU"))
    study, rows = rows_of(
        STUDIES["comparison"], "cv", "seq2seq", "mtp-go1", "gnn-rnn", "trajectron++"
    )
    return results(study, "highd", folder, rows, [1, 2, 3], {"trajectron++": "unknown network"})


def test_interval_is_that_of_students_t(content):
    """Mean 1, standard deviation 0.1, t = 4.3027 with two degrees of freedom."""
    row = next(row for row in content["rows"] if row["name"] == "mtp-go1")
    value = row["values"]["ade"]
    assert value["mean"] == pytest.approx(1.0)
    assert half_width(value) == pytest.approx(4.30265 * 0.1 / 3**0.5, rel=1e-4)
    assert row["kernels"]["anll"]["mean"] == -3.0


def test_gaps_are_named(content):
    assert gaps(content) == [
        "Seq2Seq: seed 2 failed: no GPU; not run yet: seed 3",
        "GNN-RNN: not run yet: seed 1, 2, 3",
        "Trajectron++: unknown network",
    ]
    cells = {row.name: [str(cell) for cell in row.cells] for row in main_table(content).rows}
    assert cells["Trajectron++"][:2] == ["gap", "0.44"]
    assert cells["Trajectron++"][8:12] == ["gap", "(-1.57)", "gap", "(1.63)"]


def test_ranking_says_who_is_worse_than_constant_velocity(content):
    assert [(row["name"], row["beats_cv"]) for row in content["rankings"]["ade"]] == [
        ("mtp-go1", True),
        ("cv", None),
        ("seq2seq", False),
    ]


def test_a_baseline_is_apart_from_an_interval_that_does_not_hold_it(tmp_path):
    """The interval of MTP-GO1 is 1 +- 0.248, of Seq2Seq 2.5 +- 0.248."""
    folder = StudyFolder(tmp_path)
    study, rows = rows_of(STUDIES["comparison"], "ca", "cv", "seq2seq", "mtp-go1", "gnn-rnn")

    def apart(cv, ca):
        for seed, off in ((1, -0.1), (2, 0.0), (3, 0.1)):
            write_scores(folder, "mtp-go1", seed, 1.0 + off, cv, ca=ca)
            write_scores(folder, "seq2seq", seed, 2.5 + off, cv, ca=ca)
        write_scores(folder, "gnn-rnn", 1, 3.0, cv, ca=ca)
        ranking = results(study, "highd", folder, rows, [1, 2, 3], {})["rankings"]["ade"]
        return [(row["name"], row["apart"]) for row in ranking]

    first, last = ("mtp-go1", None), ("gnn-rnn", None)  # one seed has no interval
    assert apart(1.1, 1.2) == [first, ("cv", False), ("ca", None), ("seq2seq", True), last]
    assert apart(1.5, 2.4) == [first, ("cv", True), ("ca", None), ("seq2seq", False), last]


def test_studies_without_a_row_of_constant_velocity_tell_it_as_well(tmp_path):
    folder = StudyFolder(tmp_path)
    write_scores(folder, "1", 1, 1.5, cv=2.0)
    write_scores(folder, "2", 1, 2.5, cv=2.25)
    study, rows = rows_of(STUDIES["ablation"], "1", "2")
    content = results(study, "highd", folder, rows, [1], {})
    found = [
        (row["name"], row["cv"]["mean"], row["beats_cv"]) for row in content["rankings"]["ade"]
    ]
    assert found == [("1", 2.0, True), ("2", 2.25, False)]
    assert [str(row.cells[2]) for row in ranking_table(content, "ade").rows] == ["2.000", "2.250"]


def test_latex_and_csv_have_ours_and_the_papers(content):
    latex = to_latex(content, "50 % of it")
    assert "MTP-GO1 & $\\mathbf{1.000 \\pm 0.248}$" in latex
    assert "50 \\% of it" in latex
    assert "(\\textit{-1.57})" in latex
    assert "% gap: Trajectron++: unknown network" in latex
    assert "comparison,highd,seq2seq,ade,1,2.5,,,0.57,," in to_csv(content)


def test_classes_have_columns_of_their_own(tmp_path):
    folder = StudyFolder(tmp_path)
    by_class = {
        "model": {"bicycle": {"ade": 1.5}, "car": {"ade": 1.0}},
        "cv": {"bicycle": {"ade": 1.4}, "car": {"ade": 2.0}},
    }
    scores = {"row": "mtp-go1", "seed": 1, "training": TRAINING, "values": {}}
    path = folder.run("mtp-go1", 1).scores
    write_text(path, json.dumps({**scores, "by_class": by_class}))
    study, rows = rows_of(STUDIES["static"], "mtp-go1")
    content = results(study, "ind", folder, rows, [1], {})
    (row,) = content["rows"]
    assert row["values"]["bicycle.ade"]["mean"] == 1.5
    assert row["paper"]["bicycle.fde"]["value"] == 3.38
    write_results(tmp_path, content)
    assert "bicycles ADE m" in (tmp_path / "result.md").read_text(encoding="utf-8")
    better = {key: [one["beats_cv"] for one in rank] for key, rank in content["rankings"].items()}
    assert better == {"pedestrian.ade": [], "bicycle.ade": [False], "car.ade": [True]}
    assert [table.heading for table in sections(content) if "Ranking" in table.heading] == [
        "Ranking: bicycles ADE m",
        "Ranking: cars ADE m",
    ]
