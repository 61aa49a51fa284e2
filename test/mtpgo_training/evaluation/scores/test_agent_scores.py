# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Every metric of agents whose errors are worked by hand."""

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.scores.agent_scores import (
    KEYS,
    LEVELS,
    STEP_KEYS,
    ScoredAgents,
    score_agents,
    score_paths,
)
from mtpgo_training.evaluation.scores.score_table import ScoreTable


def scored(mask=(True, True)):
    """Score one agent at rest with two modes, 1 m and 3 m aside; unit covariances."""
    mean = np.zeros((1, 2, 2, 2))
    mean[0, 0, :, 1] = [1.0, 3.0]
    covariance = np.tile(np.eye(2), (1, 2, 2, 1, 1))
    weight = np.array([[0.9, 0.1]])
    return score_agents(mean, weight, covariance, np.zeros((1, 2, 2)), np.array([mask]))


def test_all_values_of_an_agent_by_hand():
    scores = scored()
    assert set(scores.values) == set(KEYS)
    values = {key: float(value[0]) for key, value in scores.values.items()}
    assert values["ade"] == pytest.approx(2.0)
    assert values["fde"] == pytest.approx(3.0)
    assert values["mr"] == 1.0  # more than 2 m off
    assert values["apde"] == pytest.approx(2.0)
    assert values["min_ade"] == values["min_fde"] == 0.0  # the light mode is the truth
    # -ln(0.9 exp(-r^2 / 2) + 0.1) + ln(2 pi) for r = 1 m and 3 m.
    nll = [np.log(2 * np.pi) - np.log(0.9 * np.exp(-r * r / 2) + 0.1) for r in (1.0, 3.0)]
    assert values["anll"] == pytest.approx(np.mean(nll))
    assert values["fnll"] == pytest.approx(nll[1])
    # A NEES of 1 is in the ellipse of 50 % (1.386), one of 9 in none up to 95 % (5.991).
    assert [values[f"coverage_{percent}"] for percent in (50, 90, 95)] == [0.5, 0.5, 0.5]


def test_values_at_each_step_by_hand():
    scores = scored()
    assert set(scores.steps) == set(STEP_KEYS)
    np.testing.assert_allclose(scores.steps["displacement"], [[1.0, 3.0]])
    np.testing.assert_allclose(scores.steps["nees"], [[1.0, 9.0]])
    np.testing.assert_array_equal(scores.steps["coverage_50"], [[1.0, 0.0]])
    # exp(-1 / 2) = 0.607 is outside and 9 is inside 99 % (9.21): 1 - exp(-9 / 2) = 0.989.
    inside = dict(zip(LEVELS, scores.inside[0].tolist(), strict=True))
    assert (inside[0.35], inside[0.4], inside[0.95], inside[0.99]) == (0.0, 0.5, 0.5, 1.0)


def test_an_unobserved_end_has_no_final_values():
    scores = scored(mask=(True, False))
    assert scores.values["ade"] == pytest.approx([1.0])
    for key in ("fde", "fnll", "mr", "min_fde"):
        assert np.isnan(scores.values[key]).all(), key
    never = scored(mask=(False, False))
    assert all(np.isnan(value).all() for value in never.values.values())


def test_without_a_covariance_only_distances_are_scored():
    path = np.array([[[0.0, 1.0], [0.0, 3.0]]])
    truth, mask = np.zeros((1, 2, 2)), np.ones((1, 2), dtype=bool)
    scores = score_paths(path, truth, mask)
    known = {key for key, value in scores.values.items() if not np.isnan(value).any()}
    assert known == {"ade", "fde", "mr", "apde", "min_ade", "min_fde"}
    assert set(scores.values) == set(KEYS)
    assert set(scores.steps) == set(STEP_KEYS)
    assert np.isnan(scores.inside).all()
    spread = score_paths(path, truth, mask, np.tile(np.eye(2), (1, 2, 1, 1)))
    assert spread.values["ade"] == scores.values["ade"] == spread.values["min_ade"]
    np.testing.assert_allclose(spread.values["fnll"], np.log(2 * np.pi) + 4.5)


def test_an_agent_whose_covariance_is_not_known_is_in_no_share():
    """As a recorded prediction of another node may be; here one agent, and a step of the other."""
    path, truth = np.zeros((2, 2, 2)), np.zeros((2, 2, 2))
    covariance = np.tile(np.eye(2), (2, 2, 1, 1))
    covariance[0, 1], covariance[1] = np.nan, np.nan
    scores = score_paths(path, truth, np.ones((2, 2), dtype=bool), covariance)
    for percent in (50, 90, 95):
        np.testing.assert_array_equal(scores.values[f"coverage_{percent}"], [1.0, np.nan])
        known = np.isfinite(scores.steps[f"coverage_{percent}"])
        np.testing.assert_array_equal(known, [[True, False], [False, False]])
    np.testing.assert_array_equal(scores.inside[0], 1.0)
    assert np.isnan(scores.inside[1]).all()
    table = ScoreTable()
    table.add("m", "all", scores)
    assert table.averages()["m"]["all"]["coverage_90"] == 1.0


def test_some_of_the_agents_keep_their_columns():
    agents = ScoredAgents(
        "01",
        "x",
        5,
        0.2,
        np.arange(3),
        np.array([1, 2, 3], np.uint8),
        np.zeros(3, np.uint8),
        np.array([1.0, 2.0, 3.0]),
    )
    some = agents.select(np.array([True, False, True]))
    assert (some.recording, some.site, some.stamp_ns, some.step_s) == ("01", "x", 5, 0.2)
    assert some.track.tolist() == [0, 2]
    assert some.agent_class.tolist() == [1, 3]
    assert some.speed_mps.tolist() == [1.0, 3.0]
    nameless = ScoredAgents.unknown(2)
    assert nameless.track.tolist() == [-1, -1]
    assert (nameless.agent_class == AgentClass.UNKNOWN).all()
