# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cores and parameters of a measurement of the node."""

import os
from pathlib import Path

import pytest

from mtpgo_training.benchmark.node_case import NodeCase
from mtpgo_training.benchmark.node_measurement import cores, parameters_of


@pytest.mark.parametrize(
    ("usable", "expected"),
    [({0, 1, 5}, ({5}, {0, 1})), ({2, 3}, ({3}, {2})), ({4}, ({4}, {4}))],
)
def test_the_node_has_the_last_core_for_itself_where_there_are_several(
    usable, expected, monkeypatch
):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: usable)
    assert cores() == expected


def test_the_parameters_are_those_of_the_case():
    case = NodeCase(64, graph="cover", rate=5.0, neighbours=8)
    assert parameters_of(case, Path("m.pt")) == [
        "model:=m.pt",
        "rate:=5.0",
        "graph:=cover",
        "max_agents:=64",
        "max_neighbours:=8",
        "input_timeout:=1.0",
    ]


def test_a_slow_node_waits_for_its_input_for_a_period_and_0_is_the_models_own_neighbours():
    parameters = parameters_of(NodeCase(1, rate=0.5), Path("m.pt"))
    assert "input_timeout:=2.0" in parameters
    assert "max_neighbours:=0" in parameters
