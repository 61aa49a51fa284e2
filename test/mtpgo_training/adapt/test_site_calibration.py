# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration of an adapted model: of its site, of the base elsewhere, of other data."""

import dataclasses
import math

import numpy as np
import pytest
from site_data import predictions

from mtpgo_core.task.calibration import GROUPS, Calibration, CalibrationSite, GroupCalibration
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.adapt.adaptation_scores import score_site
from mtpgo_training.adapt.site_calibration import cross_calibrated, site_calibration
from mtpgo_training.calibration.calibration_text import calibration_text

RADIUS = math.sqrt(-2.0 * math.log(0.1))
"""Of the 90 % circle, in standard deviations."""

BASE = Calibration(
    groups=tuple(GroupCalibration(name, factors=(2.0, 3.0), agents=9) for name in GROUPS),
    sites=(CalibrationSite("home", 9),),
)


def errors(size, n=2000):
    """[n, 2] errors of which 90 % are smaller than ``size`` radii of the 90 % circle."""
    return np.tile(np.linspace(0.0, size * RADIUS / 0.9, n)[:, None], (1, 2))


def test_groups_that_the_site_shows_are_fitted_and_the_others_keep_the_base_models():
    fitted = site_calibration(predictions(errors(2.0)).samples(), BASE)
    by_name = {group.name: group for group in fitted.groups}
    # Drawn towards no change a little: ten of eleven parts of the way.
    assert by_name["vehicle_moving"].factors[0] == pytest.approx(4.0, rel=0.1)
    assert by_name["any_moving"].factors[0] == pytest.approx(4.0, rel=0.2)
    for name in ("pedestrian_moving", "vehicle_standing", "any_standing"):
        assert by_name[name] == BASE.groups[GROUPS.index(name)]
    assert [site.name for site in fitted.sites] == ["here"]


def test_where_the_base_model_was_calibrated_is_kept_apart_from_the_site():
    base = dataclasses.replace(BASE, left_out=True)
    first = site_calibration(predictions(errors(2.0)).samples(), base)
    assert calibration_text(first, 0.2)[:2] == [
        "fitted to validation recordings: here (2000)",
        "groups that were hardly there, as before the adaptation: fitted to left-out sites: "
        "home (9)",
    ]
    again = site_calibration(predictions(errors(2.0)).samples(), first)
    assert [(origin.sites[0].name, origin.left_out) for origin in again.base] == [
        ("here", False),
        ("home", True),
    ]
    task = TaskDescription(horizon_steps=2, calibration=again)
    assert TaskDescription.from_json(task.to_json()).calibration == again


@pytest.mark.parametrize(("predicted", "own"), [(100, True), (99, False)])
def test_a_group_is_fitted_from_a_hundred_predictions_on(predicted, own):
    fitted = site_calibration(predictions(errors(2.0, predicted)).samples(), BASE)
    place = GROUPS.index("vehicle_moving")
    assert (fitted.groups[place] != BASE.groups[place]) == own


def test_a_calibration_that_keeps_nothing_of_the_base_names_only_the_site():
    samples = predictions(errors(2.0)).samples()
    of_the_site = site_calibration(samples, Calibration())
    base = dataclasses.replace(BASE, groups=of_the_site.groups)
    assert site_calibration(samples, base) == of_the_site
    assert of_the_site.base == ()


def test_without_a_calibration_of_the_base_all_groups_are_fitted():
    fitted = site_calibration(predictions(errors(2.0)).samples(), Calibration())
    assert all(group.factors[0] > 2.0 for group in fitted.groups)


def test_a_base_with_another_horizon_is_not_used():
    base = dataclasses.replace(
        BASE, groups=tuple(dataclasses.replace(g, factors=(2.0,)) for g in BASE.groups)
    )
    fitted = site_calibration(predictions(errors(2.0)).samples(), base)
    assert {len(group.factors) for group in fitted.groups} == {2}


def test_each_half_is_calibrated_by_the_other():
    # The errors of the second half are twice as large: each half is calibrated for the other.
    both = np.concatenate([errors(1.0), errors(2.0)])
    given = predictions(both)
    calibrated = cross_calibrated(given, Calibration())
    factor = calibrated.covariance[:, 0, 0, 0, 0]
    assert factor[0] == pytest.approx(4.0, rel=0.1)
    assert factor[-1] == pytest.approx(1.0, rel=0.1)
    np.testing.assert_array_equal(calibrated.mean, given.mean)
    inside = score_site(calibrated).coverage_90[1.0]
    assert inside == pytest.approx(0.5 * (1.0 + 0.45), abs=0.03)
