# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What ``mtpgo study --list`` says of the rows' costs."""

import dataclasses

import pytest
import torch

from mtpgo_training.study import study_costs
from mtpgo_training.study.study_rows import find_study, row_config
from mtpgo_training.training.networks import build_network


@pytest.fixture
def comparison():
    """Two rows of the comparison, of which one is trained."""
    study = find_study("comparison")
    return dataclasses.replace(study, rows=tuple(study.chosen(["cv", "seq2seq"])))


def test_rows_and_parameters(comparison):
    table = study_costs.costs_table(comparison)
    assert [(row.name, row.cells[1]) for row in table.rows] == [("cv", "-"), ("seq2seq", "62608")]


def test_measured_hours_are_scenes_times_epochs_over_the_rate(comparison, monkeypatch):
    """The paper's 80 323 training scenes of highD, 100 epochs, at 1000 scenes a second: 2.2 h.

    On a GPU a step of 128 scenes has 10 000 operations of 10 µs, and a hundredth of the 0.128 s
    that a core computes: 1264 scenes a second.
    """
    monkeypatch.setattr(study_costs, "scenes_per_second", lambda model, config: 1000.0)
    monkeypatch.setattr(study_costs, "operations_per_step", lambda model, config: 10_000)
    table = study_costs.costs_table(comparison, measure=True)
    assert table.heads[-5:-2] == ["scenes/s", "highd h", "round h"]
    assert table.heads[-2:] == [f"{name} h, one GPU (estimate)" for name in ("highd", "round")]
    assert table.rows[0].cells[-5:] == ["-"] * 5
    assert table.rows[1].cells[-5:] == ["1000", "2.2", "0.6", "1.8", "0.5"]
    assert table.rows[2].cells[-4:] == ["2.2", "0.6", "1.8", "0.5"]


def test_operations_are_counted_forwards_and_backwards():
    """A product and a sum; their gradients are one expansion and two products."""
    a, b = (torch.ones(3, requires_grad=True) for _ in range(2))
    with study_costs.OperationCount() as counted:
        (a * b).sum().backward()
    assert 5 <= counted.operations <= 8  # PyTorch begins with a gradient of one, detaches some


def test_operations_do_not_depend_on_the_number_of_scenes(monkeypatch):
    (row,) = find_study("comparison").chosen(["seq2seq"])
    config = row_config(row, "round", None, ())
    counts = []
    for scenes in (2, 4):
        monkeypatch.setattr(study_costs, "COUNTED_SCENES", scenes)
        model = build_network(config.network, config.model, config.history, config.scene)
        counts.append(study_costs.operations_per_step(model, config))
    assert counts[0] == counts[1] > 1000


@pytest.mark.parametrize("name", ["seq2seq", "trajectron++"])
def test_a_step_of_every_objective_is_measured(comparison, name, monkeypatch):
    """Those with the common loss and those with an objective of their own."""
    monkeypatch.setattr(study_costs, "MEASURED_SCENES", 4)
    (row,) = find_study("comparison").chosen([name])
    study = dataclasses.replace(comparison, rows=(row,))
    table = study_costs.costs_table(study, measure=True)
    assert float(table.rows[0].cells[-2]) > 0.0
