# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sums over groups of agents, in whatever portions they come."""

import pickle

import numpy as np
import pandas as pd
import pytest
from known_paths import agents, paths

from mtpgo_core.schema import AgentClass
from mtpgo_training.evaluation.honesty import honesty_table
from mtpgo_training.evaluation.honesty.honesty_table import (
    CLASS_GROUPS,
    HonestyTable,
    _speed_bands,
)
from mtpgo_training.evaluation.scores.score_table import average, totals


def filled(recordings=("01", "02"), instants=6):
    table = HonestyTable()
    for recording in recordings:
        for k in range(instants):
            cars = agents(3, 0.2 * k, recording)
            table.add("m", "all", cars, paths(cars, error_m=0.1 * k**2, weight=(0.8, 0.2)))
            table.add("cv", "all", cars, paths(cars, error_m=3.0, sigma_m=None))
            walkers = agents(2, 0.2 * k, recording, AgentClass.PEDESTRIAN, 0.2, first=3)
            table.add("m", "all", walkers, paths(walkers, error_m=2.0, weight=(0.8, 0.2)))
    return table


def test_groups_are_averages_of_their_agents():
    found = average(totals(filled().sums(), ["model", "agent_class", "motion", "speed"]))
    walkers = found.loc["m", "pedestrian", "standing", "0-1"]
    assert walkers["squared_error_5s"] == pytest.approx(4.0)
    assert walkers["ellipse_50_5s"] == 0.0
    cars = found.loc["m", "car", "moving", "5-15"]
    squared = [(0.1 * k**2) ** 2 for k in range(6)]
    assert cars["squared_error_5s"] == pytest.approx(np.mean(squared))
    assert np.isnan(found.loc["cv", "car", "moving", "5-15"]["ellipse_50_5s"])
    groups = totals(filled().sums(), ["class_group"])["count", "overlaps"]
    assert groups.to_dict() == {"vehicle": 2 * 6 * 3 * 2, "pedestrian": 2 * 6 * 2}


def test_every_class_is_in_one_group():
    members = [kind for group in CLASS_GROUPS.values() for kind in group]
    assert sorted(members) == sorted(AgentClass)
    table, nameless = HonestyTable(), agents(3, 0.0, "01", AgentClass.UNKNOWN)
    table.add("m", "all", nameless, paths(nameless, error_m=1.0))
    assert list(table.sums().index.get_level_values("class_group")) == ["unknown"]


def test_the_portions_that_are_computed_together_make_no_difference(monkeypatch):
    whole, jumps = filled().sums(), filled().jumps()
    monkeypatch.setattr(honesty_table, "AT_ONCE", 4)
    pd.testing.assert_frame_equal(filled().sums().sort_index(), whole.sort_index())
    columns = ["jump", "mixture_jump"]
    by = ["model", "agent_class"]
    pd.testing.assert_frame_equal(
        filled().jumps().groupby(by, observed=True)[columns].sum(),
        jumps.groupby(by, observed=True)[columns].sum(),
    )
    # The error grows by 0.1 (2 k + 1) from instant k to the next.
    cars = jumps[(jumps.model == "m") & (jumps.agent_class == "car")]
    assert len(cars) == 2 * 5 * 3
    distinct = sorted(cars["jump"].round(4).unique().tolist())
    assert distinct == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])


def test_tables_of_processes_are_merged():
    one, two = filled(["01"]), pickle.loads(pickle.dumps(filled(["02"])))
    one.merge(two)
    both = filled()
    pd.testing.assert_frame_equal(one.sums(), both.sums())
    assert len(one.jumps()) == len(both.jumps())
    empty = HonestyTable()
    empty.merge(filled())
    pd.testing.assert_frame_equal(empty.sums(), both.sums())


def test_an_empty_table_has_no_rows():
    assert len(HonestyTable().sums()) == len(HonestyTable().jumps()) == 0
    nobody = HonestyTable()
    nobody.add("m", "all", agents(0), paths(agents(0)))
    assert len(nobody.sums()) == 0


def test_speeds_are_in_bands():
    speeds = np.array([0.0, 0.99, 1.0, 14.9, 15.0, 25.0, 60.0, np.nan])
    names = [honesty_table.SPEED_BANDS[i] for i in _speed_bands(speeds)]
    assert names == ["0-1", "0-1", "1-5", "5-15", "15-25", "25+", "25+", "unknown"]
