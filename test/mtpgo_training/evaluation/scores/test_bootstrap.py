# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from mtpgo_training.evaluation.scores.agent_scores import KEYS
from mtpgo_training.evaluation.scores.bootstrap import (
    bootstrap,
    bootstrap_ratio,
    over_groups,
    over_seeds,
    pooled,
    resampling_counts,
    seed_groups,
)


def test_the_interval_is_that_of_a_slow_bootstrap():
    rng = np.random.default_rng(3)
    sums, counts = rng.uniform(5.0, 9.0, (6, 1)), rng.integers(3, 8, (6, 1)).astype(float)
    drawn = resampling_counts(6)
    values = []
    for row in drawn:
        chosen = np.repeat(np.arange(6), row.astype(int))
        values.append(sums[chosen].sum() / counts[chosen].sum())
    low, high = bootstrap(sums, counts, drawn)
    np.testing.assert_allclose([low[0], high[0]], np.percentile(values, [2.5, 97.5]))
    assert low[0] < pooled(sums, counts)[0] < high[0]


def test_its_width_is_that_of_the_mean_of_many_recordings():
    rng = np.random.default_rng(1)
    sums = rng.normal(3.0, 1.0, 400)[:, None]
    low, high = bootstrap(sums, np.ones((400, 1)), resampling_counts(400))
    assert (high - low)[0] == pytest.approx(2 * 1.96 / 20.0, rel=0.1)


def test_the_resampling_is_the_same_every_time():
    np.testing.assert_array_equal(resampling_counts(5), resampling_counts(5))
    assert (resampling_counts(5).sum(axis=1) == 5).all()


def test_one_recording_has_no_interval():
    assert resampling_counts(1) is None
    low, high = bootstrap(np.ones((1, 2)), np.ones((1, 2)), None)
    assert np.isnan([*low, *high]).all()
    # Two recordings, but only one of them has such agents.
    low, high = bootstrap(np.array([[2.0], [0.0]]), np.array([[1.0], [0.0]]), resampling_counts(2))
    assert np.isnan([*low, *high]).all()


def test_a_constant_ratio_has_an_interval_of_no_width():
    rng = np.random.default_rng(2)
    sums, counts = rng.uniform(1.0, 9.0, 5), np.ones(5)
    low, high = bootstrap_ratio(0.5 * sums, counts, sums, counts, resampling_counts(5))
    assert (low, high) == (pytest.approx(0.5), pytest.approx(0.5))


def test_intervals_over_seeds_are_students_t():
    mean, low, high = over_seeds([1.0, 2.0, 3.0])
    assert mean == 2.0
    assert high - mean == pytest.approx(4.302653 / np.sqrt(3.0))
    assert mean - low == pytest.approx(high - mean)
    assert np.isnan(over_seeds([1.0])[1:]).all()
    wide = over_seeds(list(np.linspace(0.0, 1.0, 22)))
    assert wide[2] - wide[0] == pytest.approx(
        2.080 * np.std(np.linspace(0, 1, 22), ddof=1) / np.sqrt(22), rel=0.01
    )


def test_names_with_a_seed_are_grouped_by_recipe():
    names = ["a-seed1", "a-seed2", "b_seed3", "c", "d-seed1"]
    assert seed_groups(names) == {"a": ["a-seed1", "a-seed2"]}
    assert seed_groups(["x", "y"], all_together=True) == {"seeds": ["x", "y"]}


def test_intervals_of_groups_of_seeds():
    scores = {
        name: {"all": dict.fromkeys(KEYS, 0.5) | {"ade": ade, "fde": None}}
        for name, ade in (("a-seed1", 1.0), ("a-seed2", 2.0))
    }
    row = over_groups(scores, {"a": ["a-seed1", "a-seed2"]})["a"]
    assert row["models"] == ["a-seed1", "a-seed2"]
    assert row["all"]["ade"]["mean"] == 1.5
    assert row["all"]["ade"]["high"] == pytest.approx(1.5 + 12.70620 * 0.5)
    assert "fde" not in row["all"]
