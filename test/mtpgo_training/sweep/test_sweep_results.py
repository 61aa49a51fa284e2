# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One table of a sweep, from the results of its runs."""

import json

import pytest

from mtpgo_training.sweep.sweep_folder import SweepFolder
from mtpgo_training.sweep.sweep_grid import grid_points
from mtpgo_training.sweep.sweep_results import gaps, remark, results, results_table
from mtpgo_training.table_format import to_text


def write(folder, point, ade, validation=("01",)):
    files = folder.run(point.name)
    files.path.mkdir(parents=True)
    training = {"minutes": 2.0, "epochs": 2, "steps": 4, "parameters": 77}
    content = {
        "name": point.name,
        "settings": dict(point.settings),
        "seed": point.seed,
        "values": {"model": {"ade": ade, "anll": None}, "cv": {"ade": 2.0}},
        "training": training,
        "validation": None if validation is None else list(validation),
    }
    files.scores.write_text(json.dumps(content), encoding="utf-8")


@pytest.fixture
def sweep(tmp_path):
    folder, points = SweepFolder(tmp_path), grid_points(["a=1,2,3", "seed=1,2"], 1)
    for point, ade in zip(points, (1.0, 1.2, 0.9, 1.4), strict=False):
        write(folder, point, ade)
    folder.run(points[4].name).write_error(ValueError("odd"))
    return folder, points


def test_the_best_has_the_smallest_mean_not_the_smallest_value(sweep):
    content = results(*sweep)
    assert content["best"] == "a=1,seed=1"
    assert content["rows"][0]["values"]["ade"]["mean"] == pytest.approx(1.1)
    assert content["rows"][0]["values"]["anll"] is None


def test_the_table_has_mean_spread_and_baselines(sweep):
    text = to_text(results_table(results(*sweep)))
    lines = [line.split() for line in text.splitlines()]
    assert lines[0] == ["ADE", "m", "runs", "min", "parameters"]
    assert lines[1] == ["a=1", "*", "1.100", "±", "0.141", "2", "2.0", "77"]
    assert lines[3] == ["a=3", "-", "0", "-", "-"]
    assert lines[4] == ["cv", "2.000", "-", "-", "-"]


def test_what_is_missing_is_named(sweep):
    assert gaps(results(*sweep)) == ["a=3: seed 1 failed: odd; not run yet: seed 2"]


def test_runs_on_other_recordings_are_not_called_comparable(sweep):
    folder, points = sweep
    assert "not all validated on the same" not in remark(results(*sweep))
    write(folder, points[5], 1.0, validation=("02",))
    assert "not all validated on the same" in remark(results(*sweep))
