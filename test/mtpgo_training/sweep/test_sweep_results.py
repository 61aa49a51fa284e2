# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One table of a sweep, from the results of its runs."""

import csv
import json

import pytest

from mtpgo_training.sweep.sweep_folder import SweepFolder
from mtpgo_training.sweep.sweep_grid import grid_points
from mtpgo_training.sweep.sweep_results import (
    gaps,
    remark,
    results,
    results_table,
    write_results,
)
from mtpgo_training.table_format import to_text


def write(folder, point, ade, validation=("01",), steps=25, **scores):
    files = folder.run(point.name)
    files.path.mkdir(parents=True, exist_ok=True)
    training = {"minutes": 2.0, "epochs": 2, "steps": 4, "parameters": 77}
    content = {
        "name": point.name,
        "settings": dict(point.settings),
        "seed": point.seed,
        "values": {"model": {"ade": ade, "anll": None} | scores, "cv": {"ade": 2.0}},
        "training": training,
        "validation": None if validation is None else list(validation),
        "horizon": {"steps": steps, "dt_s": 0.2},
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


def test_the_coverage_is_of_moving_road_users_at_the_last_time(sweep):
    folder, points = sweep
    pooled, moving = {"coverage_90": 0.5}, {"moving_n": 8, "coverage_90_moving_1s": 0.25}
    write(folder, points[0], 1.0, **pooled, **moving, coverage_90_moving_5s=0.75)
    write(folder, points[1], 1.2, **pooled, **moving, coverage_90_moving_5s=0.875)
    write(folder, points[2], 0.9, **pooled)  # of an earlier version
    content = results(folder, points)
    table = results_table(content)
    assert list(table.heads[1:4]) == ["ADE m", "moving 90% 5s", "runs"]
    assert [row.cells[1] for row in table.rows] == ["0.812 ± 0.088", "-", "-", "-"]
    assert "moving 90%: share of moving road users" in remark(content)
    write_results(folder, content)
    with (folder.path / "result.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["coverage_90_moving_5s"] for row in rows] == ["0.75", "0.875", "", ""]
    # Runs with a shorter horizon do not have the same value.
    write(folder, points[3], 1.4, **moving)
    heads = results_table(results(folder, points)).heads
    assert list(heads[1:4]) == ["ADE m", "moving 90% 1s", "moving 90% 5s"]


def test_what_is_missing_is_named(sweep):
    assert gaps(results(*sweep)) == ["a=3: seed 1 failed: odd; not run yet: seed 2"]


def test_runs_on_other_recordings_are_not_called_comparable(sweep):
    folder, points = sweep
    assert "not all validated on the same" not in remark(results(*sweep))
    write(folder, points[5], 1.0, validation=("02",))
    assert "not all validated on the same" in remark(results(*sweep))


def test_of_runs_with_different_horizons_none_is_the_best(sweep):
    folder, points = sweep
    assert "different times" not in remark(results(*sweep))
    write(folder, points[5], 0.2, steps=5)
    content = results(folder, points)
    assert (content["best"], content["baselines"]) == (None, {})
    text = to_text(results_table(content))
    assert "*" not in text
    assert "cv" not in text
    assert "predict different times ahead" in remark(content)
    write_results(folder, content)
    assert "predict different times ahead" in (folder.path / "result.md").read_text("utf-8")
