# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of known predictions: by hand, and with a calibration fitted to other data."""

import math

import numpy as np
import pytest

from mtpgo_training.adapt.site_predictions import SitePredictions
from mtpgo_training.adapt.site_scores import fit_scale, score_site


def predictions(error, sigma=1.0, speed=10.0, known=None, cv_error=3.0):
    """One mode whose errors along x are ``error`` [n, H] (m), with a circular covariance."""
    error = np.asarray(error, dtype=np.float32)
    n, h = error.shape
    truth = np.zeros((n, h, 2), np.float32)
    mean = np.zeros((n, 1, h, 2), np.float32)
    mean[:, 0, :, 0] = error
    straight = np.zeros((n, h, 2), np.float32)
    straight[..., 1] = cv_error
    covariance = np.broadcast_to(sigma**2 * np.eye(2, dtype=np.float32), (n, 1, h, 2, 2)).copy()
    mask = np.ones((n, h), np.bool_) if known is None else np.asarray(known)
    speeds = np.broadcast_to(np.float32(speed), n).copy()
    return SitePredictions(
        np.zeros((n, 1), np.float32), mean, covariance, truth, mask, straight, speeds
    )


def test_errors_are_those_of_moving_agents_and_the_likelihood_of_all():
    speed = np.array([10.0, 10.0, 0.1], np.float32)
    scores = score_site(predictions([[1.0, 1.0], [2.0, 2.0], [0.0, 0.0]], speed=speed), 1.0, 1.0)
    assert scores.moving == 2
    assert scores.ade_m == pytest.approx(1.5)
    assert scores.constant_velocity_ade_m == pytest.approx(3.0)
    assert scores.nll == pytest.approx(math.log(2.0 * math.pi) + 0.5 * (1.0 + 4.0) / 3.0)


def test_steps_that_are_not_observed_do_not_count():
    known = [[True, False], [True, True]]
    scores = score_site(predictions([[1.0, 50.0], [3.0, 3.0]], known=known), 1.0, 1.0)
    assert scores.ade_m == pytest.approx(2.0)


def test_coverage_is_that_of_moving_agents_at_each_time():
    radius = math.sqrt(-2.0 * math.log(0.1))  # of the 90 % circle, in sigmas
    errors = np.full((4, 3), 0.9 * radius)
    errors[0, 2] = errors[1, 2] = 1.1 * radius
    coverage = score_site(predictions(errors), 1.0, 1.0).coverage_90
    assert coverage[1.0] == 1.0
    assert coverage[3.0] == 0.5
    assert math.isnan(coverage[5.0])  # beyond the horizon
    assert score_site(predictions(errors), 1.0, 2.0).coverage_90[3.0] == 1.0


def test_a_calibration_is_scored_on_other_data_than_it_was_fitted_to():
    # The errors of the second half are larger, so each half is calibrated wrongly for the other.
    errors = np.concatenate([np.full((50, 1), 1.0), np.full((50, 1), 1.5)])
    together = predictions(errors)
    assert score_site(together, 1.0, fit_scale(together)).coverage_90[1.0] == 1.0
    assert score_site(together, 1.0).coverage_90[1.0] == 0.5


def test_plain_data_has_none_for_what_is_not_known():
    plain = score_site(predictions([[1.0]]), 1.0, 1.0).to_dict()
    assert plain["coverage_90"] == {"1": 1.0, "3": None, "5": None}
    assert plain["moving"] == 1


def test_nothing_to_fit_leaves_the_covariances_alone():
    assert fit_scale(predictions(np.zeros((0, 2)))) == 1.0
