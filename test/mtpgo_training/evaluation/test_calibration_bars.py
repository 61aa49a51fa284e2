# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Both calibrations on a site, and the bars."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner, find_model
from mtpgo_training.evaluation.calibration_bars import SiteCalibration, measure_calibration
from mtpgo_training.evaluation.scorer import Scorer

AHEAD_M = {1: 3.5, 3: 5.0, 5: 0.0}
"""How far the truth is ahead of the prediction, whose sigma is 2 m in that direction: outside of
the ellipse of 50 % at 1 s, of both at 3 s."""


@pytest.fixture
def predicted():
    """A prediction of two road users, and the truth."""
    recording = make_recording(duration_s=12.0)
    prediction = perfect_prediction(recording, 10)
    truth = Scorer(recording).ground_truth(prediction.key, prediction.stamp_ns, 25, 0.2)
    position = truth.position.copy()
    for time_s, ahead_m in AHEAD_M.items():
        position[:, 5 * time_s - 1, 0] += ahead_m
    return prediction, dataclasses.replace(truth, position=position)


def test_shares_are_those_of_the_truths_in_each_ellipse(predicted):
    prediction, truth = predicted
    site = SiteCalibration()
    site.add("shipped", prediction, truth)
    wider = dataclasses.replace(prediction, sigma_factor_50=np.full((2, 25), 2.0))
    site.add("online", wider, truth)
    assert site.predictions == 2
    assert site.shares("shipped", 0.9).tolist() == [1.0, 0.0, 1.0]
    assert site.shares("shipped", 0.5).tolist() == [0.0, 0.0, 1.0]
    assert site.shares("online", 0.5).tolist() == [1.0, 0.0, 1.0]
    assert site.nll("online") == site.nll("shipped")
    unseen = dataclasses.replace(truth, mask=np.zeros_like(truth.mask))
    site.add("shipped", prediction, unseen)
    assert site.shares("shipped", 0.9).tolist() == [1.0, 0.0, 1.0]


def test_the_bars_that_are_missed_are_named_where_there_are_road_users_enough(predicted):
    site = SiteCalibration(agents=9)
    for calibration in ("shipped", "online"):
        site.add(calibration, *predicted)
    assert site.misses == []
    site.agents = 10
    assert [text.partition(":")[0] for text in site.misses] == [
        *(f"90 % at {t} s" for t in (1, 3, 5)),
        *(f"50 % at {t} s" for t in (1, 3, 5)),
        f"NLL {site.nll('online'):.3f}, expected below {site.nll('shipped'):.3f}",
    ]
    assert site.misses[1] == "90 % at 3 s: 0.000, expected 0.87 to 0.93"


def test_short_recordings_follow_each_other_and_the_first_seconds_do_not_count():
    runner = ModelRunner.load(find_model("default"))
    one, two = (braking_cars(name, tracks=2, seconds=4.0) for name in ("01", "02"))
    alone = measure_calibration(runner, [one], after_s=2.0)
    assert (alone.agents, alone.predictions) == (2, 2 * 5)  # at 2.0, 2.4, ... 3.6 s
    whole = measure_calibration(runner, [two], after_s=0.0)
    assert whole.predictions > 2 * 5
    both = measure_calibration(runner, [one, two], after_s=2.0)
    assert (both.agents, both.predictions) == (4, alone.predictions + whole.predictions)
    assert both.nll("online") != both.nll("shipped")
    assert np.isfinite(both.shares("online", 0.9)[:2]).all()
    late = measure_calibration(runner, [one, two], after_s=100.0)
    assert (late.agents, late.predictions) == (0, 0)
    assert np.isnan(late.shares("online", 0.9)).all()
    assert np.isnan(late.nll("online"))
