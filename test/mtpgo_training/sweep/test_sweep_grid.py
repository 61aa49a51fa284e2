# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of a sweep: values, ranges, combinations, names."""

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.sweep.sweep_grid import GridPoint, grid_points, setting_text, swept_keys


def test_all_combinations_with_their_seeds_one_after_the_other():
    points = grid_points(["model.hidden=32,48", "seed=1..3"], seed=9)
    assert [(setting_text(dict(p.settings)), p.seed) for p in points] == [
        ("model.hidden=32", 1),
        ("model.hidden=32", 2),
        ("model.hidden=32", 3),
        ("model.hidden=48", 1),
        ("model.hidden=48", 2),
        ("model.hidden=48", 3),
    ]
    assert points[0].overrides() == ["model.hidden=32", "seed=1"]
    assert points[0].name == "model.hidden=32,seed=1"


def test_without_seeds_the_configurations_own_is_taken():
    (point,) = grid_points(["model.layer=gat+"], seed=9)
    assert point == GridPoint((("model.layer", "gat+"),), 9)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1..3,7", ["1", "2", "3", "7"]),
        ("0..10..5", ["0", "5", "10"]),
        ("-1..1", ["-1", "0", "1"]),
        ("1e-3,2E-3,0.003", ["0.001", "0.002", "0.003"]),
        ("true,false", ["true", "false"]),
        ("[noise],[]", ["[noise]", "[]"]),
        ("null", ["null"]),
    ],
)
def test_values_are_yaml_or_ranges(text, values):
    points = grid_points([f"a.b={text}"], seed=1)
    assert [dict(point.settings)["a.b"] for point in points] == values


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["model.hidden"], "expected KEY=VALUE,VALUE or KEY=FIRST..LAST"),
        (["=3"], "expected KEY=VALUE"),
        (["a="], "expected KEY=VALUE"),
        (["a=3..1"], "expected KEY=VALUE"),
        (["a=[1"], "expected KEY=VALUE"),
        (["a=1..3..0"], "expected KEY=VALUE"),
        (["a=1", "a=2"], "names a twice"),
        (["a=1,2,1"], "gives a the value 1 twice"),
        (["seed=x"], "gives seed the value x, expected integers"),
        (["a=1..200", "b=1..200"], "asks for 40000 runs, expected at most 10000"),
        (["a=0..9999999"], "expected KEY=VALUE"),
    ],
)
def test_what_is_no_grid_is_one_sentence(words, sentence):
    with pytest.raises(ConfigurationError, match=sentence.replace("[", r"\[")) as caught:
        grid_points(words, seed=1)
    assert "\n" not in str(caught.value)


def test_names_of_folders_are_safe_short_and_different():
    odd = GridPoint((("data.train", "[a/b, '..']"),), 1)
    other = GridPoint((("data.train", "[a_b, '..']"),), 1)
    long = GridPoint(tuple((f"model.some_long_key_{n}", "value") for n in range(20)), 1)
    for point in (odd, other, long):
        assert "/" not in point.name
        assert len(point.name) <= 120
    assert odd.name != other.name
    assert swept_keys(["a.b=1", "seed=1..3"]) == ["a.b", "seed"]
