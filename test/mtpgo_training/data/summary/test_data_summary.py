# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of many recordings together, and their text."""

import dataclasses
import json

import numpy as np
from traffic import braking_cars

from mtpgo_training.data.summary.data_summary import MOST_RECORDINGS, DataSummary
from mtpgo_training.data.summary.recording_defects import Defect
from mtpgo_training.data.summary.recording_summary import summarise


def test_totals_and_text():
    one = summarise(braking_cars("01", tracks=3))
    cut = braking_cars("02", tracks=4, rate=25.0)
    two = summarise(cut.select_rows((cut.track > 0) | (cut.frame < 5)))
    gone = Defect("unreadable", "03_tracks.csv has no rows below its header")
    summary = DataSummary([one, two], [gone])
    assert summary.classes == {"car": 7}
    assert summary.duration_s == one.duration_s + two.duration_s
    weights = [one.manoeuvre_count, two.manoeuvre_count]
    expected = np.average([r.manoeuvres["braking"] for r in (one, two)], weights=weights)
    np.testing.assert_allclose(summary.manoeuvres["braking"], expected)
    assert [item.kind for item in summary.defects] == ["unreadable", "short track"]
    text = summary.to_text()
    for words in (
        "2 recordings, 17.9 s, at 10, 25 Hz, 1 site",
        "7 road users: 7 car",
        "1 x unreadable (files that cannot be read)",
        "    03_tracks.csv has no rows below its header",
        "1 x short track (road users observed for less than 1 s)",
        "recording 02, track 100: ",
    ):
        assert words in text
    total = json.loads(json.dumps(summary.to_json(), allow_nan=False))["total"]
    assert total["defects"] == {"unreadable": 1, "short track": 1}
    assert total["tracks"] == 7


def test_long_lists_are_cut_in_the_text_only():
    one = summarise(braking_cars("01", tracks=1))
    many = DataSummary([dataclasses.replace(one, name=f"r{i}") for i in range(50)])
    assert f"... and {50 - MOST_RECORDINGS} more" in many.to_text()
    assert len(many.to_json()["recordings"]) == 50
    assert "No defects found." in many.to_text()


def test_a_defect_of_a_speed_does_not_fill_the_line():
    recording = braking_cars("01", tracks=1)
    recording.velocity[0] = [1e300, 0.0]
    assert " 1e+300 " in DataSummary([summarise(recording)]).to_text()


def test_quantiles_of_speeds_are_those_of_all_rows():
    """A slow recording and a fast one: the mean of their quantiles would be those of neither."""
    fast, slow = braking_cars("01", tracks=6, seconds=60.0), braking_cars("02", tracks=3)
    slow.velocity[:] *= 0.1
    speeds = np.linalg.norm(np.concatenate([fast.velocity, slow.velocity]), axis=1)
    expected = np.quantile(speeds[speeds > 0.5], [0.05, 0.5, 0.95])
    summary = DataSummary([summarise(fast), summarise(slow)])
    (line,) = (line for line in summary.to_text().splitlines() if line.startswith("car "))
    found = [float(cell) for cell in line.split()[-4:-1]]
    np.testing.assert_allclose(found, expected, atol=0.15)
    (alone,) = (
        line for line in DataSummary([summarise(slow)]).to_text().splitlines() if "car  " in line
    )
    own = np.linalg.norm(slow.velocity, axis=1)
    assert float(alone.split()[-3]) == round(float(np.median(own[own > 0.5])), 1)
