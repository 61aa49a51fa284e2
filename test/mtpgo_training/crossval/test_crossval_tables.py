# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a cross-validation and of two beside each other."""

import functools

import pytest
from crossval_results import content, group

from mtpgo_training.crossval.crossval_tables import (
    POOLED,
    comparison_table,
    differences,
    scores_table,
    trainings_table,
    unscored_sites,
)
from mtpgo_training.crossval.site_scores import LEAST_AGENTS
from mtpgo_training.table_format import to_text


def rows_of(table):
    return {row.name: dict(zip(table.heads[1:], row.cells, strict=True)) for row in table.rows}


def test_each_site_has_its_groups_and_the_mean_stands_below():
    table = scores_table(
        content({"a": {"all": group(1.0), "moving": group(1.0)}, "b": {"all": group(3.0)}}),
        "recorded",
    )
    rows = rows_of(table)
    assert list(rows) == [
        "a: moving",
        "a: all",
        "b: all !",
        f"{POOLED}: moving",
        f"{POOLED}: all",
    ]
    assert rows[f"{POOLED}: all"]["ADE m"] == "2.000"
    assert rows["a: moving"]["in 90% 1/3/5 s"] == "0.90/0.85/0.80"
    assert rows["a: all"]["in 90% 1/3/5 s"] == "-"
    assert rows["b: all !"]["/ CV"] == "1.50"


def test_sites_that_are_left_out_together_have_rows_of_their_own():
    sites = {"a": {"moving": group(1.0)}, "b": {"moving": group(3.0, n=10_000)}}
    given = content(sites, folds={"both": ["a", "b"]})
    rows = rows_of(scores_table(given, "recorded"))
    assert list(rows) == ["a: moving", "b: moving !", f"{POOLED}: moving"]
    assert rows[f"{POOLED}: moving"]["ADE m"] == "2.000"
    [trained] = trainings_table(given).rows
    assert (trained.name, trained.cells[-1]) == ("both", "a, b")


def test_sites_of_which_nothing_could_be_scored_are_named():
    given = content({"a": {"all": group(1.0)}, "b": {}, "c": {"all": group(1.0, n=0)}})
    unscored = unscored_sites(given)
    assert [sentence.split(" could be scored")[0] for sentence in unscored] == [
        "no road user of the site b",
        "no road user of the site c",
    ]
    assert "(observations: recorded)" in unscored[0]


def test_moving_road_users_come_first_and_few_are_left_out():
    groups = ("all", "standing", "vehicle moving", "turning", "moving", "pedestrian standing")
    given = {name: group(1.0, n=LEAST_AGENTS) for name in groups}
    given |= {"bicycle moving": group(1.0, n=LEAST_AGENTS - 1)}
    table = scores_table(content({"a": given}), "recorded", manoeuvres=True)
    assert [row.name.removeprefix("a: ") for row in table.rows][:6] == [
        "vehicle moving",
        "moving",
        "standing",
        "pedestrian standing",
        "all",
        "turning",
    ]
    assert "bicycle moving" not in to_text(table)
    few = scores_table(content({"a": {"all": group(1.0, n=1)}}), "recorded")
    assert [row.name for row in few.rows] == ["a: all"]


def test_the_table_fits_a_wide_terminal():
    sites = {"roundabouts": {"pedestrian standing": group(9.0, n=1_000_000)}}
    table = to_text(scores_table(content(sites), "recorded"))
    assert max(map(len, table.splitlines())) <= 120


def test_manoeuvres_are_shown_on_request():
    given = content({"a": {"standing": group(1.0), "turning": group(1.0)}})
    usual = [row.name for row in scores_table(given, "recorded").rows]
    assert usual == ["a: standing", f"{POOLED}: standing"]
    shown = [row.name for row in scores_table(given, "recorded", manoeuvres=True).rows]
    assert shown[:2] == ["a: standing", "a: turning"]


def test_times_since_the_start_are_shown_on_request():
    given = content({"a": {"moving": group(1.0), "moving, 0-20 s": group(2.0)}})
    for table in (
        functools.partial(scores_table, given, "recorded"),
        functools.partial(comparison_table, given, given, ("one", "two")),
    ):
        assert [row.name for row in table(manoeuvres=True).rows][:2] == [
            "a: moving",
            f"{POOLED}: moving",
        ]
        shown = [row.name for row in table(since_start=True).rows]
        assert shown[:2] == ["a: moving", "a: moving, 0-20 s"]


def test_what_was_trained_is_told():
    text = to_text(trainings_table(content({"a": {}})))
    assert "11 of 12" in text
    assert "0.50" in text


def test_sites_are_compared_whatever_they_were_left_out_with():
    sites = {"a": {"moving": group(1.0)}, "b": {"moving": group(2.0)}}
    first, second = content(sites), content(sites, folds={"both": ["b", "a"]})
    table = comparison_table(first, second, ("alone", "together"))
    assert [row.name for row in table.rows] == ["a: moving", "b: moving", f"{POOLED}: moving"]


def test_two_results_are_compared_on_what_both_have():
    first = content({"a": {"all": group(1.0, nll=1.0)}, "b": {"all": group(9.0)}})
    second = content({"a": {"all": group(0.5, nll=-0.5, five=0.9), "moving": group(1.0)}})
    table = comparison_table(first, second, ("old", "new"))
    assert [row.name for row in table.rows] == ["a: all", f"{POOLED}: all"]
    assert list(table.heads[:5]) == ["site, road users", "n", "ADE m old", "new", "ratio"]
    cells = [str(cell) for cell in table.rows[0].cells]
    assert cells[:4] == ["100", "1.000", "0.500", "0.50"]
    assert cells[7:10] == ["1.500", "1.500", "1.00"]
    assert cells[10:16] == ["0.875", "0.875", "1.00", "0.25", "0.25", "+0.00"]
    assert cells[16:22] == ["0.80", "0.90", "+0.10", "1.00", "-0.50", "-1.50"]
    assert cells[22:] == ["1.250", "1.250", "1.00"]
    heads = list(table.heads)[2::3]
    assert heads[3:5] + heads[-1:] == ["Brier old", "nearest old", "jump m old"]
    assert [str(cell) for cell in table.rows[1].cells] == cells


def test_the_means_that_are_compared_are_over_the_same_sites():
    first, second = (
        content({"a": {"moving": group(1.0)}, "b": {"moving": group(9.0, n=n)}})
        for n in (LEAST_AGENTS - 1, LEAST_AGENTS)
    )
    for pair in ((first, second), (second, first)):
        table = comparison_table(*pair, ("old", "new"))
        assert [row.name for row in table.rows] == ["a: moving", f"{POOLED}: moving"]
        assert [str(cell) for cell in table.rows[1].cells][:4] == ["100", "1.000", "1.000", "1.00"]


def test_values_that_neither_has_are_not_compared():
    without = {key: value for key, value in group(1.0).items() if key not in ("brier", "chance")}
    first = content({"a": {"all": without | {"jump": None}}})  # of an earlier version
    table = comparison_table(first, first, ("old", "new"))
    assert list(table.heads)[2::3] == [
        f"{title} old"
        for title in ("ADE m", "minADE m", "brier-minFDE m", "nearest", "in 90% 5 s", "NLL")
    ]
    both = comparison_table(first, content({"a": {"all": group(1.0)}}), ("old", "new"))
    assert [str(cell) for cell in both.rows[0].cells[10:13]] == ["-", "0.875", "-"]


def test_the_share_of_chance_and_the_brier_score_are_told():
    given = content({"a": {"moving": group(1.0)}})
    table = scores_table(given, "recorded", brier=True)
    assert [row.cells[7] for row in table.rows] == ["0.25/0.12"] * 2
    assert rows_of(table)["a: moving"]["Brier"] == "0.875"
    assert "Brier" not in scores_table(given, "recorded").heads
    earlier = {key: value for key, value in group(1.0).items() if key not in ("chance", "brier")}
    table = scores_table(content({"a": {"moving": earlier}}), "recorded", brier=True)
    row = rows_of(table)["a: moving"]
    assert (row["nearest"], row["Brier"]) == ("0.25", "-")


@pytest.mark.parametrize("other", [None, 0.0])
def test_a_value_that_is_not_there_has_no_ratio(other):
    first, second = (content({"a": {"all": group(1.0) | {"min_ade": v}}}) for v in (other, 1.0))
    row = comparison_table(first, second, ("old", "new")).rows[0]
    expected = "-" if other is None else "0.000"
    assert [str(cell) for cell in row.cells][4:7] == [expected, "1.000", "-"]


def test_different_numbers_of_agents_are_both_told():
    first, second = (content({"a": {"all": group(1.0, n=n)}}) for n in (100, 200))
    row = comparison_table(first, second, ("old", "new")).rows[0]
    assert str(row.cells[0]) == "100, 200"


def test_what_differs_is_told_beside_a_comparison():
    def made(last_s, stride_s=1.0, together="a"):
        given = content({"a": {"all": group(1.0)}})
        horizon = {"model": {"all": {"time_s": [0.2, last_s]}}}
        given["folds"][0]["sites"]["a"]["breakdowns"] = {"recorded": {"by_horizon": horizon}}
        facts = {"budget": {"minutes": 1.0}, "stride_s": stride_s}
        return given | facts | {"left_out_together": {"fold": [together]}}

    assert differences(made(5.0), made(5.0)) == []
    assert differences(made(None), made(5.0)) == []
    assert differences(made(5.0), made(3.0)) == [
        "the models predict 5 and 3 s ahead, so their errors cannot be compared"
    ]
    assert differences(made(5.0), made(5.0, 2.0, "b")) == [
        "stride_s is 1.0 and 2.0",
        "other sites are left out together, so the models were trained on other sites",
    ]
