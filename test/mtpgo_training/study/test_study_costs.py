# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``mtpgo study --list`` says of the rows' costs."""

import dataclasses

import pytest

from mtpgo_training.study import study_costs
from mtpgo_training.study.study_rows import find_study


@pytest.fixture
def comparison():
    """Two rows of the comparison, of which one is trained."""
    study = find_study("comparison")
    return dataclasses.replace(study, rows=tuple(study.chosen(["cv", "seq2seq"])))


def test_rows_and_parameters(comparison):
    table = study_costs.costs_table(comparison)
    assert [(row.name, row.cells[1]) for row in table.rows] == [("cv", "-"), ("seq2seq", "62608")]


def test_measured_hours_are_scenes_times_epochs_over_the_rate(comparison, monkeypatch):
    """The paper's 80 323 training scenes of highD, 100 epochs, at 1000 scenes a second: 2.2 h."""
    monkeypatch.setattr(study_costs, "scenes_per_second", lambda model, config: 1000.0)
    table = study_costs.costs_table(comparison, measure=True)
    assert table.heads[-3:] == ["scenes/s", "highd h", "round h"]
    assert table.rows[0].cells[-3:] == ["-", "-", "-"]
    assert table.rows[1].cells[-3:] == ["1000", "2.2", "0.6"]
    assert table.rows[2].cells[-2:] == ["2.2", "0.6"]


@pytest.mark.parametrize("name", ["seq2seq", "trajectron++"])
def test_a_step_of_every_objective_is_measured(comparison, name, monkeypatch):
    """Those with the common loss and those with an objective of their own."""
    monkeypatch.setattr(study_costs, "MEASURED_SCENES", 4)
    (row,) = find_study("comparison").chosen([name])
    study = dataclasses.replace(comparison, rows=(row,))
    table = study_costs.costs_table(study, measure=True)
    assert float(table.rows[0].cells[-2]) > 0.0
