# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples for a calibration: from predictions, from files, with and without a calibration."""

import dataclasses

import numpy as np
import pytest
from calibration_sets import random_samples

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.calibrated_prediction import calibrated_covariances, calibrated_weights
from mtpgo_core.quality import metrics
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_training.calibration.calibration_samples import (
    CalibrationSamples,
    SampledRecording,
    load_samples,
    merge_samples,
)

NAMES = ("site", "group", "distance", "log_determinant", "log_weight", "mode_error")


def assert_equal(one, other):
    assert (one.step_s, one.sites) == (other.step_s, other.sites)
    for name in (*NAMES, "mode_distance", "mode_log_determinant"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def some_predictions(n=40, modes=3, steps=15):
    """Mean, weight, covariance and truth of random predictions."""
    draw = np.random.default_rng(3)
    root = draw.normal(size=(n, modes, steps, 2, 2))
    covariance = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(2)
    mean, truth = draw.normal(size=(n, modes, steps, 2)), draw.normal(size=(n, steps, 2))
    return mean, draw.dirichlet(np.ones(modes), n), covariance, truth


def test_the_likelihood_of_the_mixture_is_that_of_the_predictions_before_and_after():
    mean, weight, covariance, truth = some_predictions()
    mask = np.ones(truth.shape[:2], dtype=bool)
    mask[0, 4] = False
    group = np.arange(len(mean)) % len(GROUPS)
    given = {"group": group, "step_s": 0.2, "sites": ("a",)}
    samples = CalibrationSamples.of(mean, weight, covariance, truth, mask, **given)
    assert samples.steps == {1.0: 4, 3.0: 14}
    groups = tuple(
        GroupCalibration(name, tuple(1.0 + i + 0.1 * k for k in range(15)), 1.0 + 0.4 * i)
        for i, name in enumerate(GROUPS)
    )
    calibration = Calibration(groups)
    calibrated = (
        calibrated_weights(weight, group, calibration),
        calibrated_covariances(covariance, group, calibration),
    )
    for found, (w, c) in (
        (samples, (weight, covariance)),
        (samples.calibrated(calibration), calibrated),
        (samples.calibrated(calibration).uncalibrated(calibration), (weight, covariance)),
    ):
        expected = metrics.nll(mean, w, c, truth)[:, [4, 14]]
        expected[0, 0] = np.nan
        np.testing.assert_allclose(found.nll, expected, rtol=1e-4, atol=1e-4)


def test_samples_carry_the_factors_of_the_50_percent_ellipses():
    groups = tuple(
        GroupCalibration(name, (2.0, 2.0), sigma_factors_50=(0.5, 0.6 + 0.01 * i))
        for i, name in enumerate(GROUPS)
    )
    plain = compared()
    assert (plain.sigma_factor_50 == 1.0).all()
    after = plain.calibrated(Calibration(groups))
    np.testing.assert_allclose(after.sigma_factor_50, [[0.5, 0.61], [0.5, 0.65]])
    again = after.uncalibrated(Calibration(groups))
    assert (again.sigma_factor_50 == 1.0).all()
    np.testing.assert_allclose(again.distance, plain.distance)


def test_samples_of_an_earlier_version_have_no_likelihood_of_the_mixture(tmp_path):
    now = random_samples(1, n=3)
    arrays = {name: getattr(now, name) for name in NAMES}
    path = tmp_path / "calibration.npz"
    np.savez(path, format=1, step_s=0.2, sites=np.array(["a"]), **arrays)
    then = CalibrationSamples.load(path)
    np.testing.assert_array_equal(then.distance, now.distance)
    assert then.nll.shape == (3, 3)
    assert np.isnan(then.nll).all()
    assert np.isfinite(now.nll).all()
    assert_equal(merge_samples([then, now]).select(np.arange(3, 6)), now)
    np.savez(path, format=3, step_s=0.2, sites=np.array(["a"]), **arrays)
    with pytest.raises(ConfigurationError, match="has samples of format 3, expected 1 or 2"):
        CalibrationSamples.load(path)


def compared(mask=((True, True), (True, False))):
    """Two agents with two modes over two steps; the second mode is the heavier one."""
    mean = np.zeros((2, 2, 2, 2))
    mean[:, 0, :, 0] = 9.0
    covariance = np.zeros((2, 2, 2, 2, 2))
    covariance[..., 0, 0], covariance[..., 1, 1] = 4.0, 0.25
    truth = np.zeros((2, 2, 2))
    truth[:, 0, 0], truth[:, 1, 1] = 2.0, 1.0
    return CalibrationSamples.of(
        mean,
        np.array([[0.25, 0.75], [0.4, 0.6]]),
        covariance,
        truth,
        np.array(mask),
        group=np.array([1, 5]),
        step_s=0.2,
        sites=("a", "b"),
        site=np.array([1, 0]),
    )


def test_distances_are_of_the_heaviest_mode_where_the_truth_is_known():
    samples = compared()
    np.testing.assert_allclose(samples.distance, [[1.0, 4.0], [1.0, np.nan]])
    np.testing.assert_allclose(samples.log_determinant, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.exp(samples.log_weight), [[0.25, 0.75], [0.4, 0.6]], rtol=1e-6)
    # The other mode is 7 m and sqrt(82) m from the truth, and only the first agent is known
    # at the last step.
    expected = [[(7.0 + np.sqrt(82.0)) / 2.0, 1.5], [np.nan, np.nan]]
    np.testing.assert_allclose(samples.mode_error, expected, rtol=1e-6)
    assert samples.of_site("b").group.tolist() == [1]
    assert samples.without_site("b").group.tolist() == [5]


def doubling(temperature):
    groups = (
        GroupCalibration(name=name, factors=(2.0, 8.0), temperature=temperature) for name in GROUPS
    )
    return Calibration(groups=tuple(groups))


def test_calibrated_samples_are_those_of_calibrated_predictions():
    after = compared().calibrated(doubling(2.0))
    np.testing.assert_allclose(after.distance, [[0.5, 0.5], [0.5, np.nan]])
    np.testing.assert_allclose(
        after.log_determinant, np.log([[4.0, 64.0]] * 2), rtol=1e-6
    )  # a covariance of two dimensions
    root = np.sqrt([0.25, 0.75])
    np.testing.assert_allclose(np.exp(after.log_weight[0]), root / root.sum(), rtol=1e-6)
    np.testing.assert_array_equal(after.mode_error, compared().mode_error)


def test_a_calibration_can_be_taken_back():
    before, calibration = compared(), doubling(0.5)
    again = before.calibrated(calibration).uncalibrated(calibration)
    for name in ("distance", "log_determinant", "log_weight"):
        np.testing.assert_allclose(getattr(again, name), getattr(before, name), atol=1e-5)
    assert before.calibrated(Calibration()) is before


def test_samples_of_equal_sites_are_merged():
    one, two = random_samples(1, sites=("a", "b"), n=2), random_samples(2, sites=("b", "c"), n=3)
    merged = merge_samples([one, two])
    assert merged.sites == ("a", "b", "c")
    assert merged.site.tolist() == [0, 0, 1, 1, 1, 1, 1, 2, 2, 2]
    np.testing.assert_array_equal(merged.distance[4:], two.distance)


def test_samples_say_which_recordings_they_are_of(tmp_path):
    one, two = (SampledRecording(name, "site", "ind", 64 * name) for name in "ab")
    samples = dataclasses.replace(random_samples(1, n=4), recordings=(one, two))
    samples.save(tmp_path / "calibration.npz")
    found = CalibrationSamples.load(tmp_path / "calibration.npz")
    assert found.recordings == (one, two)
    other = dataclasses.replace(random_samples(2, n=2), recordings=(two,))
    assert merge_samples([other, found.thinned(1)]).recordings == (two, one)
    random_samples(1, n=4).save(tmp_path / "none.npz")
    assert CalibrationSamples.load(tmp_path / "none.npz").recordings == ()


def test_samples_of_models_with_another_horizon_are_not_merged():
    parts = [random_samples(1, n=2, steps=steps) for steps in (5, 25)]
    with pytest.raises(ConfigurationError, match=r"5 steps of 0.2 s, 3 modes, 25 steps"):
        merge_samples(parts)
    with pytest.raises(ConfigurationError, match="there are no samples"):
        merge_samples([])


def test_a_large_site_is_thinned_evenly_and_a_small_one_is_not():
    samples = random_samples(1, sites=("a", "b"), n=(10, 4))
    kept = samples.thinned(5)
    assert kept.site.tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 1]
    np.testing.assert_array_equal(kept.distance[:5], samples.distance[:10:2])


def test_samples_are_read_as_they_were_written_from_files_and_folders(tmp_path):
    one, two = random_samples(1, sites=("a",), n=3), random_samples(2, sites=("b",), n=2)
    one.save(tmp_path / "folds" / "a" / "calibration.npz")
    two.save(tmp_path / "folds" / "b" / "calibration.npz")
    assert_equal(CalibrationSamples.load(tmp_path / "folds" / "a" / "calibration.npz"), one)
    assert_equal(load_samples([tmp_path]), merge_samples([one, two]))
    twice = [tmp_path / "folds" / "b", tmp_path / "folds" / "b" / "calibration.npz"]
    assert_equal(load_samples(twice), two)


def test_what_holds_no_samples_is_one_sentence(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.npz").write_text("no archive")
    np.savez(tmp_path / "other.npz", distance=np.zeros(3))
    for name, sentence in (
        ("missing.npz", "does not exist"),
        ("empty", "holds no calibration.npz"),
        ("text.npz", "holds no samples for a calibration"),
        ("other.npz", "holds no samples for a calibration"),
    ):
        with pytest.raises(ConfigurationError, match=sentence) as caught:
            load_samples([tmp_path / name])
        assert "\n" not in str(caught.value)
