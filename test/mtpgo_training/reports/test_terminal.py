# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The text printed after an evaluation."""

import pytest
from known_scores import json_content

from mtpgo_training.evaluation.bags.agreement import Agreement
from mtpgo_training.evaluation.bags.bag_evaluation import BagResult
from mtpgo_training.evaluation.evaluator import Evaluation
from mtpgo_training.reports.terminal import print_result, seeds_text


@pytest.fixture
def content():
    return json_content() | {"notes": []}


def test_seeds_have_a_line_for_each_protocol_with_the_important_values():
    value = {"mean": 1.0, "low": 0.5, "high": 1.5}
    unknown = {"mean": 2.0, "low": None, "high": None}
    row = {"models": ["a", "b"], "all": {"ade": value, "mr": value}, "centre": {"fde": unknown}}
    assert seeds_text("x", row).splitlines() == [
        "x, 2 seeds, all: ade 1.000 (0.500..1.500)",
        "x, 2 seeds, centre: fde 2.000 (-)",
    ]


def test_protocols_without_results_are_left_out(content, capsys):
    print_result(content, BagResult(Evaluation()))
    text = capsys.readouterr().out
    assert text.startswith("all agents:\n")
    assert "each agent in the centre of its graph" not in text
    assert "95 % interval" in text
    assert "x, 2 seeds, all: ade 1.875 (" in text


def test_a_note_replaces_the_intervals_and_comes_last(content, capsys):
    result = BagResult(Evaluation(), {"bag": {"m": Agreement()}})
    print_result(content | {"notes": ["one recording"]}, result)
    lines = capsys.readouterr().out.splitlines()
    assert not any("95 % interval" in line for line in lines)
    assert lines[-2].startswith("bag and m: nothing to compare")
    assert lines[-1] == "Note: one recording."
