# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a score book tells beyond its averages, against sums done by hand."""

import pickle

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.manoeuvres import MANOEUVRES
from mtpgo_training.evaluation.details import details, over_groups, seed_groups
from mtpgo_training.evaluation.scorebook import ScoreBook
from mtpgo_training.evaluation.scorepage import KEYS, LEVELS

H = 5
KEEP, STANDS = 1 << MANOEUVRES.index("lane_keep"), 1 << MANOEUVRES.index("standing")


def add(book, error, recording="01", model="m", n=4, kind=AgentClass.CAR, bits=KEEP, known=H):
    """n agents whose one mode is ``error`` metres beside the truth, with unit covariance."""
    truth = np.zeros((n, H, 2))
    mean = truth[:, None] + (0.0, error)
    mask = np.tile(np.arange(H) < known, (n, 1))
    book.add(
        model,
        "all",
        mean=mean,
        weight=np.ones((n, 1)),
        covariance=np.tile(np.eye(2), (n, 1, H, 1, 1)),
        truth=truth,
        mask=mask,
        recording=recording,
        agent_class=np.full(n, kind, np.uint8),
        manoeuvres=np.full(n, bits, np.uint8),
    )


def filled():
    book = ScoreBook(step_s=0.2)
    add(book, 1.0, "01", n=4)
    add(book, 2.0, "02", n=2, kind=AgentClass.TRUCK, bits=STANDS)
    add(book, 4.0, "03", n=2, known=3, bits=0)
    for recording, n in (("01", 4), ("02", 2), ("03", 2)):
        add(book, 4.0, recording, "cv", n=n)
    return book


def test_groups_have_their_own_averages():
    found = details(filled())
    assert {k: v["ade"] for k, v in found["by_class"]["m"]["all"].items()} == {
        "car": pytest.approx((4 * 1.0 + 2 * 4.0) / 6),
        "truck": 2.0,
    }
    assert {k: (v["ade"], v["n"]) for k, v in found["by_manoeuvre"]["m"]["all"].items()} == {
        "lane_keep": (1.0, 4),
        "standing": (2.0, 2),
    }
    assert {k: v["ade"] for k, v in found["by_recording"]["m"]["all"].items()} == {
        "01": 1.0,
        "02": 2.0,
        "03": 4.0,
    }
    assert found["by_class"]["m"]["all"]["truck"]["fde"] == 2.0


def test_the_horizon_counts_who_is_observed():
    rows = details(filled())["by_horizon"]["m"]["all"]
    assert rows["time_s"] == [0.2, 0.4, 0.6, 0.8, 1.0]
    assert rows["n"] == [8, 8, 8, 6, 6]
    assert rows["nees_expected"] == 2.0
    assert rows["displacement"] == pytest.approx([2.0, 2.0, 2.0, 8 / 6, 8 / 6])
    # With unit covariance the NEES is the squared distance, by mode and by mixture alike.
    squared = [(4 * 1 + 2 * 4 + 2 * 16) / 8] * 3 + [(4 * 1 + 2 * 4) / 6] * 2
    assert rows["nees"] == pytest.approx(squared)
    assert rows["nees_mixture"] == pytest.approx(squared)
    assert rows["displacement_low"][0] < 2.0 < rows["displacement_high"][0]


def test_reliability_goes_through_the_coverages():
    book = filled()
    found = details(book)["reliability"]["m"]["all"]
    at = dict(zip(found["level"], found["observed"], strict=True))
    scores = book.table().models["m"]["all"]
    for percent in (50, 90, 95):
        assert at[percent / 100] == pytest.approx(scores[f"coverage_{percent}"])
    # A distance of 1 lies in the ellipses from 1 - exp(-1 / 2) = 39 % on, 2 from 86 % on.
    assert at[0.35] == 0.0
    assert at[0.4] == pytest.approx(4 / 8)
    assert at[0.9] == pytest.approx(6 / 8)
    assert found["level"] == list(LEVELS)


def test_intervals_over_recordings_and_the_share_of_constant_velocity():
    found = details(filled())
    low, high = found["intervals"]["m"]["all"]["ade"]
    assert low == pytest.approx(1.0)  # 01 drawn three times
    assert 2.0 < high <= 4.0
    share = found["relative"]["m"]["all"]["ade"]
    assert share["value"] == pytest.approx(2.0 / 4.0)
    assert share["low"] == pytest.approx(0.25)
    assert found["relative"]["cv"]["all"]["ade"] == {"value": 1.0, "low": 1.0, "high": 1.0}


def test_one_recording_has_no_intervals():
    book = ScoreBook()
    add(book, 1.0)
    found = details(book)
    assert found["intervals"]["m"]["all"]["ade"] == [None, None]
    assert found["by_horizon"]["m"]["all"]["displacement_low"] == [None] * H
    assert found["by_horizon"]["m"]["all"]["time_s"] == [None] * H
    assert found["relative"]["m"]["all"] == {}


def test_books_from_several_processes_are_one():
    whole, parts = filled(), [ScoreBook(step_s=0.2), ScoreBook()]
    add(parts[0], 1.0, "01", n=1)
    add(parts[1], 1.0, "01", n=3)
    add(parts[1], 2.0, "02", n=2, kind=AgentClass.TRUCK, bits=STANDS)
    add(parts[1], 4.0, "03", n=2, known=3, bits=0)
    for recording, n in (("01", 4), ("02", 2), ("03", 2)):
        add(parts[1], 4.0, recording, "cv", n=n)
    parts[0].merge(pickle.loads(pickle.dumps(parts[1])))
    assert parts[0].table() == whole.table()
    assert details(parts[0]) == details(whole)


def test_a_path_without_covariance_has_no_calibration():
    book = ScoreBook()
    book.add_path(
        "ca", "all", path=np.zeros((2, H, 2)), truth=np.ones((2, H, 2)), mask=np.ones((2, H), bool)
    )
    found = details(book)
    assert found["reliability"]["ca"]["all"] == {}
    assert found["by_horizon"]["ca"]["all"]["nees"] == [None] * H
    assert found["by_horizon"]["ca"]["all"]["displacement"] == pytest.approx([2**0.5] * H)


def test_names_tell_seeds():
    names = ["a-seed1", "a-seed2", "b_seed3", "c", "d-seed1"]
    assert seed_groups(names) == {"a": ["a-seed1", "a-seed2"]}
    assert seed_groups(["x", "y"], all_together=True) == {"seeds": ["x", "y"]}


def test_over_seeds():
    scores = {
        name: {"all": dict.fromkeys(KEYS, 0.5) | {"ade": ade, "fde": None}}
        for name, ade in (("a-seed1", 1.0), ("a-seed2", 2.0))
    }
    row = over_groups(scores, {"a": ["a-seed1", "a-seed2"]})["a"]
    assert row["models"] == ["a-seed1", "a-seed2"]
    assert row["all"]["ade"]["mean"] == 1.5
    assert row["all"]["ade"]["high"] == pytest.approx(1.5 + 12.706 * 0.5)
    assert "fde" not in row["all"]
