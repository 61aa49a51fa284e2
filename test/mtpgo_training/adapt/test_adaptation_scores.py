# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of known predictions, by hand."""

import math

import numpy as np
import pytest
from site_data import predictions

from mtpgo_training.adapt.adaptation_scores import score_site


def test_errors_are_those_of_moving_agents_and_the_likelihood_of_all():
    speed = np.array([10.0, 10.0, 0.1], np.float32)
    scores = score_site(predictions([[1.0, 1.0], [2.0, 2.0], [0.0, 0.0]], speed=speed))
    assert scores.moving == 2
    assert scores.ade_m == pytest.approx(1.5)
    assert scores.constant_velocity_ade_m == pytest.approx(3.0)
    assert scores.nll == pytest.approx(math.log(2.0 * math.pi) + 0.5 * (1.0 + 4.0) / 3.0)


def test_steps_that_are_not_observed_do_not_count():
    known = [[True, False], [True, True]]
    scores = score_site(predictions([[1.0, 50.0], [3.0, 3.0]], known=known))
    assert scores.ade_m == pytest.approx(2.0)


def test_coverage_is_that_of_moving_agents_at_each_time():
    radius = math.sqrt(-2.0 * math.log(0.1))  # of the 90 % circle, in sigmas
    errors = np.full((4, 3), 0.9 * radius)
    errors[0, 2] = errors[1, 2] = 1.1 * radius
    coverage = score_site(predictions(errors)).coverage_90
    assert coverage[1.0] == 1.0
    assert coverage[3.0] == 0.5
    assert math.isnan(coverage[5.0])  # beyond the horizon
    wider = predictions(errors, sigma=1.5)
    assert score_site(wider).coverage_90[3.0] == 1.0


def test_plain_data_has_none_for_what_is_not_known():
    plain = score_site(predictions([[1.0]])).to_dict()
    assert plain["coverage_90"] == {"1": 1.0, "3": None, "5": None}
    assert plain["moving"] == 1
