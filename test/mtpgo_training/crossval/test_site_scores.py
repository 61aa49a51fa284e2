# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of a site by group, and their mean in which every site counts equally."""

import numpy as np
import pytest
from known_paths import agents, paths
from known_scores import STANDS, add

from mtpgo_core.schema import AgentClass
from mtpgo_training.crossval.site_scores import (
    LEAST_AGENTS,
    group_scores,
    pooled_scores,
    worse_than_simple,
)
from mtpgo_training.evaluation.honesty.honesty_table import HonestyTable
from mtpgo_training.evaluation.scores.score_table import ScoreTable


def site_table(error=1.0, cv=4.0, ca=2.0):
    """Ten moving cars and five standing pedestrians; the error of the cars' model grows."""
    table = ScoreTable()
    for model, metres in (("model", error), ("cv", cv), ("ca", ca)):
        add(table, np.full(5, metres), model=model, n=10, step_s=1.0)
        add(
            table,
            np.full(5, 0.5),
            model=model,
            n=5,
            kind=AgentClass.PEDESTRIAN,
            speed=0.0,
            bits=STANDS,
            step_s=1.0,
        )
    return table


def test_groups_are_those_of_class_motion_and_manoeuvre():
    scores = group_scores(site_table(), HonestyTable())
    assert list(scores) == [
        "all",
        "moving",
        "standing",
        "vehicle moving",
        "pedestrian standing",
        "lane_keep",
    ]
    counts = {group: row["n"] for group, row in scores.items()}
    assert counts == {
        "all": 15,
        "moving": 10,
        "standing": 5,
        "vehicle moving": 10,
        "pedestrian standing": 5,
        "lane_keep": 10,
    }


def test_moving_ones_are_given_by_the_time_since_the_start():
    table, honesty = ScoreTable(), HonestyTable()
    for since_s, error in ((5.0, 1.0), (70.0, 2.0)):
        for model in ("model", "cv"):
            add(table, error, model=model, n=10, step_s=1.0, since_start_s=since_s)
        who = agents(10, since_s)
        honesty.add("model", "all", who, paths(who, error_m=error, weight=(0.75, 0.25)))
    rows = group_scores(table, honesty)
    assert (rows["moving, 0-20 s"]["ade"], rows["moving, 60-120 s"]["ade"]) == (1.0, 2.0)
    assert rows["moving, 60-120 s"]["coverage_90_at"]["5"] == 1.0
    ratio = rows["moving, 60-120 s"]["sigma_to_rmse_at"]["5"]
    assert ratio == pytest.approx(2.0**0.5 / 2.0)
    assert "moving, 20-60 s" not in rows


def test_errors_stand_beside_those_of_the_baselines():
    row = group_scores(site_table(), HonestyTable())["vehicle moving"]
    assert (row["ade"], row["ade_cv"], row["ade_ca"]) == (1.0, 4.0, 2.0)
    assert (row["ratio_cv"], row["ratio_ca"]) == (0.25, 0.5)
    everybody = group_scores(site_table(), HonestyTable())["all"]
    assert everybody["ade"] == pytest.approx((10 * 1.0 + 5 * 0.5) / 15)


def test_coverage_is_given_by_time():
    table = ScoreTable()
    # 2.146 standard deviations are the radius of the 90 % ellipse.
    add(table, np.array([1.0, 1.0, 2.0, 2.0, 2.2]), model="model", n=4, step_s=1.0)
    add(table, np.array([2.2, 1.0, 2.0, 2.0, 2.2]), model="model", n=1, step_s=1.0)
    add(table, 9.0, model="cv", n=5, step_s=1.0)
    row = group_scores(table, HonestyTable())["moving"]
    assert row["coverage_90_at"] == {"1": 0.8, "3": 1.0, "5": 0.0}


def test_scores_of_centre_agents_alone_do_not_count():
    table = site_table()
    add(table, 9.0, model="model", n=40, step_s=1.0, protocol="centre")
    assert group_scores(table, HonestyTable()) == group_scores(site_table(), HonestyTable())


def test_a_horizon_that_ends_earlier_has_no_coverage_there():
    table = ScoreTable()
    add(table, 1.0, model="model", step_s=0.2)
    row = group_scores(table, HonestyTable())["moving"]
    assert row["coverage_90_at"] == {"1": 1.0, "3": None, "5": None}
    assert (row["ade_cv"], row["ratio_cv"]) == (None, None)


def test_honesty_is_that_of_the_group():
    honesty = HonestyTable()
    for who, error_m in ((agents(10), 1.0), (agents(5, kind=AgentClass.PEDESTRIAN), 3.0)):
        given = paths(who, error_m=error_m, weight=(0.75, 0.25), apart_m=2.0)
        honesty.add("model", "all", who, given)
    rows = group_scores(site_table(), honesty)
    assert rows["vehicle moving"]["sigma_to_rmse_at"]["5"] == pytest.approx(2.0**0.5)
    assert rows["moving"]["region_90_at"]["1"] is not None
    assert 0.0 <= rows["vehicle moving"]["heaviest_nearest"] <= 1.0
    assert rows["vehicle moving"]["chance"] == 0.5
    assert rows["pedestrian standing"]["heaviest_nearest"] is None


def test_every_site_counts_equally():
    first, second = (
        {"all": {"n": n, "ade": ade, "ratio_cv": ratio, "coverage_90_at": {"5": share}}}
        for n, ade, ratio, share in ((LEAST_AGENTS, 1.0, 0.5, 0.8), (100_000, 3.0, 2.0, None))
    )
    found = pooled_scores([first, second])["all"]
    assert found == {
        "sites": 2,
        "n": LEAST_AGENTS + 100_000,
        "ade": 2.0,
        "ratio_cv": pytest.approx(1.0),
        "coverage_90_at": {"5": 0.8},
    }


def test_a_fold_of_an_earlier_version_lacks_values():
    both = {"n": LEAST_AGENTS, "ade": 1.0}
    old, new = {"all": both}, {"all": both | {"chance": 0.125, "nll_at": {"5": 2.0}}}
    for sites in ([old, new], [new, old]):
        found = pooled_scores(sites)["all"]
        assert (found["chance"], found["nll_at"]) == (0.125, {"5": 2.0})


def test_a_site_with_few_agents_of_a_group_does_not_count():
    few = {"moving": {"n": LEAST_AGENTS - 1, "ade": 9.0}}
    many = {"moving": {"n": LEAST_AGENTS, "ade": 1.0}}
    assert pooled_scores([few, many])["moving"] == {"sites": 1, "n": LEAST_AGENTS, "ade": 1.0}
    assert pooled_scores([few]) == {}


@pytest.mark.parametrize(
    ("ade", "cv", "ca", "worse"),
    [
        (1.0, 1.5, 0.99, False),
        (1.03, 1.0, 1.5, True),
        (1.03, 1.5, 1.0, True),
        (5.0, None, None, False),
        (None, 1.0, 1.0, False),
    ],
)
def test_what_is_worse_than_simple(ade, cv, ca, worse):
    assert worse_than_simple({"ade": ade, "ade_cv": cv, "ade_ca": ca}) is worse
