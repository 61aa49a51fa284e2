# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers that are finite and definite in float64 but not in float32."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity, usable_covariances
from mtpgo_core.prediction.finite_output import definite_in_float32, publishable
from mtpgo_core.schema import HistoryWindow


def window(n=3, covariance=np.nan):
    """A window of one sample of agents driving along x."""
    return HistoryWindow(
        stamp_ns=1,
        frame_id="map",
        key=keys_from_integers(range(1, n + 1)),
        agent_class=np.ones(n, np.uint8),
        z=np.zeros(n),
        size=np.full((n, 2), np.nan),
        position=np.zeros((n, 1, 2)),
        velocity=np.tile([[[10.0, 0.0]]], (n, 1, 1)),
        acceleration=np.zeros((n, 1, 2)),
        yaw=np.zeros((n, 1)),
        valid=np.ones((n, 1), bool),
        covariance=np.broadcast_to(covariance, (n, 4, 4)).copy(),
    )


def constant(**values):
    given = window()
    if "covariance" in values:
        given.covariance[1] = values["covariance"]
    return predict_constant_velocity(given, horizon_steps=5, dt_s=0.2, modes=2)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mean", np.nan),
        ("mean", 1e39),
        ("yaw", np.inf),
        ("z", 1e39),
        ("weight", np.nan),
        ("weight", 0.4),
        ("covariance", 1e39),
        ("covariance", 0.0),
    ],
)
def test_only_the_agent_with_an_unusable_number_is_left_out(name, value):
    prediction = constant()
    array = getattr(prediction, name).copy()
    array[1] = value
    spoilt = dataclasses.replace(prediction, **{name: array})
    assert publishable(prediction).all()
    assert publishable(spoilt).tolist() == [True, False, True]


def test_definite_in_float64_is_not_definite_in_float32():
    nearly = np.array([[1e4, 1e4 - 1e-7], [1e4 - 1e-7, 1e4]])
    assert np.linalg.eigvalsh(nearly)[0] > 0.0
    assert not definite_in_float32(nearly)
    assert definite_in_float32(np.eye(2))


@pytest.mark.parametrize(
    "covariance",
    [
        np.zeros((4, 4)),
        -np.eye(4),
        1e38 * np.eye(4),
        1e308 * np.eye(4),
        np.full((4, 4), np.inf),
        np.ones((4, 4)),
        np.eye(4) + 2.0 * np.eye(4)[::-1],
        1e7 * (np.ones((4, 4)) + 1e-9 * np.eye(4)),
        1e-300 * np.eye(4),
    ],
    ids=[
        "zero",
        "negative",
        "1e38",
        "1e308",
        "infinite",
        "singular",
        "indefinite",
        "near-singular",
        "tiny",
    ],
)
def test_constant_velocity_is_publishable_whatever_covariance_a_tracker_sends(covariance):
    prediction = constant(covariance=covariance)
    assert publishable(prediction).all()
    others = constant()
    for row in (0, 2):
        np.testing.assert_array_equal(prediction.covariance[row], others.covariance[row])


def test_a_standard_deviation_of_more_than_a_site_is_unknown():
    found = usable_covariances(np.stack([1e10 * np.eye(4), 100.0 * np.eye(4)]))
    assert np.isnan(found[0]).all()
    np.testing.assert_array_equal(found[1], 100.0 * np.eye(4))
