# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest
from known_scores import add

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.honesty.simple_comparison import compare_with_simple
from mtpgo_training.evaluation.scores.score_table import ScoreTable


def test_a_model_is_compared_with_the_better_of_two_by_class_and_motion():
    table = ScoreTable()
    errors = {"m": (1.01, 2.1, 0.3), "cv": (2.0, 2.0, 0.1), "ca": (1.0, 4.0, 0.4)}
    for model, (car, walker, standing) in errors.items():
        add(table, car, model=model)
        add(table, walker, model=model, kind=AgentClass.PEDESTRIAN)
        add(table, standing, model=model, speed=0.0)
    found = compare_with_simple(table.agents())
    assert list(found) == ["m"]
    rows = found["m"]["all"]
    worse = {group: row["worse"] for group, row in rows.items()}
    assert worse == {"car, moving": False, "car, standing": True, "pedestrian, moving": True}
    car = rows["car, moving"]
    assert (car["class"], car["motion"], car["n"]) == ("car", "moving", 4)
    assert car["ade_to_cv"] == pytest.approx(0.505)
    assert car["ade_to_ca"] == pytest.approx(1.01)


def test_without_baselines_there_is_no_sentence():
    table = ScoreTable()
    add(table, 1.0)
    row = compare_with_simple(table.agents())["m"]["all"]["car, moving"]
    assert [row[key] for key in ("cv", "ca", "ade_to_cv", "worse")] == [None] * 4
