# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the node's scores, and of what its calibration changed."""

from mtpgo_training.reports.honesty.live_scores import (
    calibration_effect_table,
    live_table,
    live_tables,
    published_effect,
)
from mtpgo_training.table_format import to_text


def row(window_s, **values):
    scores = {"ade": 0.5, "cv_ade": 0.75, "fde": 1.0, "miss_rate": 0.1, "nll": 1.5}
    scores |= {"coverage_50": 0.4, "coverage_90": None}
    return {"window_s": window_s, "group": "two_wheeler_moving", "time_s": 3} | (
        {"agents": 12, "predictions": 300, "by_model": 300} | scores | values
    )


def test_the_longest_window_is_shown():
    text = to_text(live_table([row(60), row(1800, ade=0.625)]))
    assert len(text.splitlines()) == 2
    name, scores = text.splitlines()[1].split(", 3 s")
    assert name == "two wheeler moving"
    expected = "12 300 0.625 0.750 1.000 0.100 1.500 0.400 -"
    assert " ".join(scores.split()) == expected


def content(**published):
    models = {name: {"all": {"coverage_90": share}} for name, share in (("bag", 0.9), ("m", 0.7))}
    return {"models": models, "weights": {"m": "ff"}, "published": published}


def test_bags_with_the_online_calibration_are_beside_the_models():
    online = content(bag={"online": 90, "shipped": 10})
    effect = published_effect(online)
    assert {name: row["coverage_90"] for name, row in effect.items()} == {
        "bag, online": 0.9,
        "m, shipped": 0.7,
    }
    text = to_text(calibration_effect_table(effect))
    assert text.splitlines()[1].split()[:4] == ["bag,", "online", "-", "0.90"]
    tables = live_tables(online | {"live": {"bag": [row(1800)]}})
    assert [table.heading for table in tables] == [
        "Live scores: bag",
        "What the online calibration changes",
    ]


def test_without_online_predictions_or_a_model_nothing_is_compared():
    assert published_effect(content(bag={"shipped": 10})) == {}
    assert published_effect(content()) == {}
    assert published_effect(content(bag={"online": 10}) | {"weights": {}}) == {}
    assert live_tables(content()) == []
