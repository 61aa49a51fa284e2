# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tidy tables, and group-bys of them against sums worked out by hand."""

import pickle

import numpy as np
import pytest
from known_scores import STANDS, H, add, filled

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.scores.agent_scores import KEYS, LEVELS
from mtpgo_training.evaluation.scores.score_summary import breakdowns
from mtpgo_training.evaluation.scores.score_table import (
    HEADLINE_TIMES_S,
    SINCE_START_BANDS,
    ScoreTable,
    average,
    since_start_codes,
    totals,
)


def two_sites():
    """Cars and pedestrians at two sites; the error grows with each step by what is given."""
    table, step = ScoreTable(), np.arange(1, H + 1)
    add(table, 1.0 * step, "01", site="a", n=3, speed=10.0)
    add(table, 2.0 * step, "02", site="a", n=1, speed=10.0)
    add(table, 0.1 * step, "02", site="a", n=4, speed=0.1)
    add(table, 0.5 * step, "03", site="b", n=2, speed=1.5, kind=AgentClass.PEDESTRIAN)
    add(table, 0.3 * step, "03", site="b", n=2, speed=np.nan, known=2)
    return table


def test_a_row_for_each_agent():
    agents = filled().agents()
    assert len(agents) == len(filled()) == 16
    assert agents["model"].value_counts().to_dict() == {"m": 8, "cv": 8}
    assert agents["ade"].dtype == np.float32
    first = agents.iloc[0]
    assert (first["recording"], first["agent_class"], first["motion"]) == ("01", "car", "moving")
    assert agents.loc[agents["recording"] == "03", "fde"].isna().sum() == 2


def test_agents_and_steps_have_the_same_averages():
    table = two_sites()
    by_agent = average(totals(table.agents(), ["model", "recording"]))
    steps = totals(table.steps(), ["model", "recording", "step"])
    last = average(steps).xs(H, level="step")
    for recording in ("01", "02", "03"):
        row = by_agent.loc["m", recording]
        assert row["ade"] == pytest.approx(last.loc[("m", recording), "ade"])
        assert row["fde"] == pytest.approx(last.loc[("m", recording), "displacement"])
    levels = average(totals(table.levels(), ["model", "level"])).xs("m", level="model")["inside"]
    assert levels.index.tolist() == list(LEVELS)
    whole = average(totals(table.agents(), ["model"])).loc["m"]
    assert levels[0.9] == pytest.approx(whole["coverage_90"])


def test_coverage_and_ade_by_horizon_class_motion_and_site_are_one_group_by():
    table = two_sites()
    found = average(totals(table.steps(), ["model", "site", "agent_class", "motion", "time_s"]))
    moving = found.loc["m", "a", "car", "moving"]
    assert moving.index.tolist() == [0.2, 0.4, 0.6, 0.8, 1.0]
    # Three agents 1 m off and one 2 m off at the first step, and as much more at each step.
    np.testing.assert_allclose(moving["displacement"], 1.25 * np.arange(1, H + 1))
    np.testing.assert_allclose(moving["ade"], 1.25 * (np.arange(1, H + 1) + 1) / 2)
    # With unit covariance the ellipse of 90 % has a radius of 2.15 m.
    assert moving["coverage_90"].tolist() == [1.0, 0.75, 0.0, 0.0, 0.0]
    assert found.loc[("m", "a", "car", "standing", 1.0), "displacement"] == pytest.approx(0.5)
    assert found.loc[("m", "b", "pedestrian", "moving", 0.6), "ade"] == pytest.approx(1.0)
    # Agents that are observed for two steps have an ADE of longer horizons too, over these two.
    late = found.loc[("m", "b", "car", "unknown", 1.0)]
    assert np.isnan(late["displacement"])
    assert late["ade"] == pytest.approx(0.45)


def test_groups_of_classes_and_other_columns_are_one_group_by_of_the_agents():
    agents = two_sites().agents()
    road = agents["agent_class"].isin(["pedestrian", "bicycle"])
    groups = agents.assign(users=np.where(road, "vulnerable", "vehicles"))
    ade = average(totals(groups, ["users", "motion"]))["ade"]
    assert ade["vehicles", "moving"] == pytest.approx(1.25 * 3.0)
    assert ade["vulnerable", "moving"] == pytest.approx(1.5)
    fast = groups[groups["speed_mps"] > 5.0].groupby("site", observed=True)["ade"].mean()
    assert fast.to_dict() == pytest.approx({"a": 1.25 * 3.0})


def test_tables_from_several_processes_are_one():
    whole, parts = filled(), [ScoreTable(), ScoreTable()]
    add(parts[0], 1.0, "01", n=1)
    add(parts[1], 1.0, "01", n=3)
    add(parts[1], 2.0, "02", n=2, kind=AgentClass.TRUCK, bits=STANDS)
    add(parts[1], 4.0, "03", n=2, known=3, bits=0)
    for recording, n in (("01", 4), ("02", 2), ("03", 2)):
        add(parts[1], 4.0, recording, "cv", n=n)
    parts[0].merge(pickle.loads(pickle.dumps(parts[1])))
    assert parts[0].averages() == whole.averages()
    assert breakdowns(parts[0]) == breakdowns(whole)


def test_merging_keeps_names_that_came_in_another_order():
    one, other = ScoreTable(), ScoreTable()
    add(one, 1.0, "01", "a", site="x")
    add(other, 2.0, "02", "b", site="y")
    add(other, 3.0, "01", "a", site="x")
    one.merge(other)
    ade = one.agents().groupby(["model", "recording", "site"], observed=True)["ade"].mean()
    assert ade.to_dict() == {("a", "01", "x"): 2.0, ("b", "02", "y"): 2.0}
    steps = average(totals(one.steps(), ["model", "recording", "step"]))
    assert steps.loc[("b", "02", 1), "displacement"] == 2.0


def test_totals_are_sums_in_double_precision_over_the_agents_with_a_group():
    agents = two_sites().agents()
    agents["ade"] = np.float32(0.1)
    agents["fde"] = np.where(np.arange(len(agents)) % 3 == 0, np.nan, agents["fde"])
    agents["users"] = np.where(np.arange(len(agents)) % 4 == 0, None, "some")
    found = totals(agents, ["users", "motion"])
    for (users, motion), row in found.iterrows():
        some = agents[(agents["users"] == users) & (agents["motion"] == motion)]
        for key in KEYS:
            values = some[key].to_numpy(np.float64)
            values = values[np.isfinite(values)]
            assert row["sum", key] == pytest.approx(values.sum(), rel=1e-12)
            assert row["count", key] == len(values)
    assert len(found) == 3
    assert found["count", "ade"].sum() == np.arange(len(agents)).astype(bool).sum() - 2
    assert average(totals(agents, ["model"])).at["m", "ade"] == float(np.float32(0.1))


def test_a_merged_table_is_sent_as_one_array():
    table, instants = ScoreTable(), ScoreTable()
    for _ in range(500):
        add(instants, 1.0, n=1)
    table.merge(instants)
    assert len(table) == 500
    assert len(pickle.dumps(table)) < 500 * 76 + 5000


def test_values_that_are_not_finite_are_not_defined():
    table = ScoreTable()
    add(table, np.array([1.0, np.inf, 1.0, 1.0, np.inf]), spread=None)
    scores = table.averages()["m"]["all"]
    assert (scores["n"], scores["n_final"], scores["ade"]) == (0, 0, None)


def test_an_empty_table_has_no_rows():
    table = ScoreTable()
    assert len(table) == len(table.agents()) == len(table.steps()) == len(table.levels()) == 0
    assert table.averages() == {}
    assert set(KEYS) < set(table.agents().columns)


def test_the_headline_is_the_coverage_of_moving_agents_at_single_times():
    table = ScoreTable()
    add(table, [0.0, 0.0, 0.0, 0.0, 1.0], step_s=0.2, n=3)
    add(table, 9.0, step_s=0.2, n=1)
    add(table, 0.0, step_s=0.2, n=50, speed=0.0)
    add(table, 9.0, model="cv", speed=0.0)
    scores = table.averages()
    assert scores["m"]["all"]["coverage_90_moving_1s"] == 0.75
    assert scores["m"]["all"]["coverage_90_moving_5s"] is None  # the horizon ends at 1 s
    assert set(HEADLINE_TIMES_S) <= set(scores["cv"]["all"])
    assert scores["cv"]["all"]["coverage_90_moving_1s"] is None  # nobody moves
    total = table.headline_totals(["model", "recording"])
    assert total.loc[("m", "01"), ("count", "coverage_90_moving_1s")] == 4


def test_times_since_the_start_are_in_bands():
    seconds = np.array([0.0, 19.9, 20.0, 60.0, 119.0, 120.0, 4000.0, np.nan])
    names = [SINCE_START_BANDS[i] for i in since_start_codes(seconds)]
    assert names == ["0-20", "0-20", "20-60", "60-120", "60-120", "120+", "120+", "unknown"]
