# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What benchmarks print and write."""

import json
from types import SimpleNamespace

from mtpgo_training.benchmark.measurement.machine import command_line, machine, table, write_json


def test_the_command_that_repeats_a_measurement():
    given = {"agents": [2, 8], "input_rate": 25.0, "neighbours": None, "markers": True, "p": []}
    assert command_line("node", given) == (
        "mtpgo benchmark node --agents 2 8 --input-rate 25.0 --markers"
    )
    assert {"processor", "cores", "torch", "numpy", "python", "load"} <= set(machine())


def test_what_was_not_measured_is_null(tmp_path):
    write_json(tmp_path / "out.json", {"rows": [{"p99_ms": float("nan"), "cycles": 0}]})
    content = json.loads((tmp_path / "out.json").read_text())
    assert content["rows"] == [{"p99_ms": None, "cycles": 0}]


def test_without_a_path_nothing_is_written(tmp_path):
    write_json(None, {"rows": []})
    assert list(tmp_path.iterdir()) == []


def test_a_table_by_its_formats():
    rows = [SimpleNamespace(ms=1.25, share=0.5), SimpleNamespace(ms=float("nan"), share=1.0)]
    assert table(rows, {"p50 ms": "{.ms:.1f}", "core": "{.share:.0%}"}).splitlines() == [
        "| p50 ms | core |",
        "| ---: | ---: |",
        "| 1.2 | 50% |",
        "| - | 100% |",
    ]
