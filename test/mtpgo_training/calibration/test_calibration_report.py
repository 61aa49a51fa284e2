# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores before and after a calibration, and each site by a fit to the others."""

import dataclasses

import numpy as np
import pytest
from calibration_sets import VEHICLE, random_samples, with_distance

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import SITES_COVERAGE_KEY
from mtpgo_core.task.calibration import (
    GROUPS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
)
from mtpgo_training.calibration.calibration_fit import WIDENED_LEVEL, fit_calibration
from mtpgo_training.calibration.calibration_report import (
    calibration_table,
    leave_one_site_out,
    moving_scores,
    score_samples,
)
from mtpgo_training.calibration.calibration_samples import merge_samples
from mtpgo_training.calibration.calibration_text import (
    calibration_text,
    moving_coverage,
    moving_text,
)
from mtpgo_training.table_format import to_text


def test_scores_by_hand():
    samples = random_samples(1, n=4, steps=5)
    distance = np.full((4, 5), 1.0)
    distance[:, 4] = [1.0, 2.0, 4.0, 50.0]
    samples = with_distance(samples, distance)
    samples.log_determinant[:, 4] = np.log(16.0)
    samples.mode_log_determinant[:] = np.log(16.0)
    samples.log_weight[:] = np.log([0.5, 0.25, 0.25])
    samples.mode_error[:] = [1.0, 5.0, 5.0]
    samples.mode_error[3] = [5.0, 1.0, 5.0]
    scores = score_samples(samples)
    assert (scores.times_s, scores.known, scores.coverage) == ((1.0,), (4,), (0.75,))
    assert scores.sigma_m == pytest.approx((2.0,))
    expected = 0.5 * (57.0 / 4.0 + np.log(16.0)) + np.log(2.0 * np.pi)
    assert scores.nll == pytest.approx((expected,))  # all modes are the same
    # Of 1, 2, 4 and 50, the first is inside of 1.39, and inside of 1.39 * 1.3^2 the second, too.
    assert scores.coverage_50 == (0.25,)
    samples.sigma_factor_50[:] = 1.3
    assert score_samples(samples).coverage_50 == (0.5,)
    assert scores.heaviest_nearest == 0.75
    first, last = 0.5**2 + 2 * 0.25**2, 0.5**2 + 0.75**2 + 0.25**2
    assert scores.brier == pytest.approx((3 * first + last) / 4)
    assert scores.cross_entropy == pytest.approx((3 * np.log(2.0) + np.log(4.0)) / 4)


def test_a_mean_is_over_sites_first():
    samples = random_samples(1, sites=("a", "b"), n=(90, 10), steps=5)
    distance = np.where(samples.site == 0, 1.0, 99.0)[:, None].repeat(5, axis=1)
    scores = score_samples(with_distance(samples, distance))
    assert scores.coverage == (0.5,)
    assert scores.coverage_of_all == (0.9,)


def test_the_likelihood_in_the_table_is_that_of_the_mixture():
    """The heaviest mode misses by far, another one is right."""
    samples = random_samples(1, sites=("a", "b"), n=2000, modes=2)
    samples.log_weight[:] = np.log([0.6, 0.4])
    samples.mode_distance[:, 0] += 100.0
    scores = score_samples(with_distance_of_heaviest(samples))
    expected = -np.log(0.4) + 0.5 * samples.mode_distance[:, 1].mean(axis=0) + np.log(2.0 * np.pi)
    assert scores.nll == pytest.approx(tuple(expected), rel=1e-3)
    table = calibration_table(samples, samples)
    assert [head for head in table.heads if head.startswith("NLL")] == [
        "NLL 1 s",
        "NLL 3 s",
        "NLL 5 s",
    ]
    assert f"{expected[0]:.3f} > {expected[0]:.3f}" in table.rows[0].cells


def with_distance_of_heaviest(samples):
    """The same with the distances of the first mode at the scored steps."""
    distance = samples.distance.copy()
    distance[:, list(samples.steps.values())] = samples.mode_distance[:, 0]
    return dataclasses.replace(samples, distance=distance)


def test_moving_road_users_only_are_in_the_coverage_that_is_stored():
    moves, stands = random_samples(1, n=8), random_samples(2, n=5, group=VEHICLE - 1)
    samples = merge_samples(
        [
            with_distance(moves, np.full((8, 25), 1.0)),
            with_distance(stands, np.full((5, 25), 99.0)),
        ]
    )
    scores = moving_scores(samples)
    assert scores["moving_n"] == 8
    assert moving_coverage(scores) == {1.0: 1.0, 3.0: 1.0, 5.0: 1.0}
    assert moving_text({"ade": 1.0}) == ""


def test_the_share_of_all_road_users_and_the_mean_of_the_sites_are_told_apart():
    """One site of ninety road users, all inside, and one of ten, all outside."""
    samples = random_samples(1, sites=("a", "b"), n=(90, 10))
    distance = np.where(samples.site == 0, 1.0, 99.0)[:, None].repeat(25, axis=1)
    scores = moving_scores(with_distance(samples, distance))
    assert moving_coverage(scores) == {1.0: 0.9, 3.0: 0.9, 5.0: 0.9}
    assert moving_coverage(scores, SITES_COVERAGE_KEY) == {1.0: 0.5, 3.0: 0.5, 5.0: 0.5}
    assert moving_text(scores) == (
        "0.900 / 0.900 / 0.900 of moving road users are inside their 90 % ellipse after "
        "1 / 3 / 5 s (100 predictions), in the mean of the sites 0.500 / 0.500 / 0.500"
    )


def test_the_coverage_in_files_of_earlier_versions_is_said_to_be_the_mean_of_the_sites():
    assert moving_text({"moving_n": 8, "coverage_90_moving_5s": 0.875}) == (
        "in the mean of the sites 0.875 of moving road users are inside their 90 % ellipse "
        "after 5 s (8 predictions)"
    )


def test_without_moving_road_users_the_coverage_is_not_known():
    scores = moving_scores(random_samples(2, n=5, group=VEHICLE - 1))
    assert scores["moving_n"] == 0
    assert moving_coverage(scores) == {1.0: None, 3.0: None, 5.0: None}
    assert moving_text(scores).startswith("- / - / - of moving")


@pytest.mark.parametrize(
    ("step_s", "shown"), [(1.0, "1 s 1.00  3 s 3.00"), (2.0, "6 s 3.00"), (0.5, "1 s 2.00")]
)
def test_factors_are_shown_at_the_times_that_they_are_for(step_s, shown):
    groups = tuple(GroupCalibration(name, (1.0, 2.0, 3.0), 1.5, 9, 1) for name in GROUPS)
    text = calibration_text(Calibration(groups, (CalibrationSite("a", 9),)), step_s)
    assert text[1].endswith(f" covariance x {shown}  temperature 1.50  (9 agents, 1 sites)")


def test_each_site_is_calibrated_by_the_others_only():
    parts = [
        random_samples(seed, sites=(name,), n=4000, growth=growth)
        for seed, (name, growth) in enumerate((("a", 2.0), ("b", 2.0), ("c", 9.0)))
    ]
    samples = merge_samples(parts)
    honest = leave_one_site_out(samples)
    np.testing.assert_array_equal(honest.site, samples.site)
    np.testing.assert_array_equal(honest.mode_error, samples.mode_error)
    alone = fit_calibration(merge_samples(parts[:2]))
    expected = parts[2].calibrated(alone)
    np.testing.assert_allclose(honest.of_site("c").distance, expected.distance, rtol=1e-5)
    assert score_samples(honest.of_site("c")).coverage[-1] < 0.6
    assert score_samples(honest.of_site("a")).coverage[-1] > 0.9
    with pytest.raises(ConfigurationError, match=r"are of 1 site\(s\), expected at least two"):
        leave_one_site_out(parts[0])


def test_the_likelihood_of_too_narrow_ellipses_falls_with_the_calibration():
    samples = random_samples(1, sites=("a", "b"), n=2000, growth=6.0)
    before, after = score_samples(samples), score_samples(leave_one_site_out(samples))
    assert after.nll[-1] < before.nll[-1]
    assert after.coverage[-1] == pytest.approx(WIDENED_LEVEL, abs=0.02)
    assert before.coverage[-1] < 0.4


def test_the_table_has_a_row_for_each_group_and_site_with_road_users():
    samples = random_samples(1, sites=("a", "b"), n=300, growth=6.0)
    table = calibration_table(samples, leave_one_site_out(samples))
    names = [row.name for row in table.rows]
    assert names == ["moving", "vehicle_moving", "moving, a", "moving, b"]
    text = to_text(table)
    assert text.splitlines()[1].split()[:2] == ["moving", "600"]
    assert "nan" not in text


def test_what_lies_between_two_steps_is_not_said_to_be_at_a_time():
    """No step of 0.4 s is at 1, 3 or 5 s: the end of the horizon is given, with its time."""
    samples = dataclasses.replace(random_samples(1, steps=12), step_s=0.4)
    assert score_samples(samples).times_s == (4.8,)
    assert set(moving_scores(samples)) == {
        "moving_n",
        "coverage_90_moving_4.8s",
        "sites_coverage_90_moving_4.8s",
    }
    samples = dataclasses.replace(random_samples(1, steps=12), step_s=0.5)
    assert score_samples(samples).times_s == (1, 3, 5)
