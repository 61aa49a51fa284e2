# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requirements on the node, and the search for the largest scene."""

import dataclasses

from node_times import made

from mtpgo_training.benchmark import node_benchmark as node
from mtpgo_training.benchmark.measurement.process_usage import Usage
from mtpgo_training.benchmark.node_case import NodeCase, NodeRow, evaluate


def test_violated_requirements_are_named():
    row = evaluate(NodeCase(4), made(lambda n: 50.0, lost={9}), [Usage(1, 0.0, 500.0)], 0)
    violations = node.Requirement(NodeCase(4), p99_ms=40.0).violations(row)
    assert [sentence.split(",")[0] for sentence in violations] == [
        "1 misses",
        "p99 50 ms",
        "500 MB",
    ]
    assert (
        node.Requirement(NodeCase(4), 60.0).violations(
            evaluate(NodeCase(4), made(lambda n: 50.0), [], 0)
        )
        == []
    )


def test_the_requirements_cover_every_policy_and_both_rates():
    covered = {(each.case.agents, each.case.graph, each.case.rate) for each in node.REQUIREMENTS}
    assert (64, "scene", 5.0) in covered
    assert (32, "scene", 10.0) in covered
    assert {graph for _, graph, _ in covered} == {"scene", "cover", "each"}
    assert all(each.case.duration_s == 60.0 for each in node.REQUIREMENTS)


def test_the_largest_scene_is_found_by_halving(monkeypatch, capsys):
    tried = []

    def measured(case, model, logs, parameters=()):
        tried.append(case.agents)
        base = NodeRow(case.agents, case.graph, None, 5.0, 25.0, False, 10, 0, 0, *[1.0] * 7)
        return base if case.agents <= 72 else dataclasses.replace(base, misses=1)

    monkeypatch.setattr(node, "measure", measured)
    monkeypatch.setattr(node, "require_node_tools", lambda: None)
    rows = node.print_largest(["cover"], NodeCase(0), "default", "x", None, step=8, most=512)
    assert [row.agents for row in rows] == [72]
    assert len(tried) <= 7
    assert "| 72 | cover |" in capsys.readouterr().out
