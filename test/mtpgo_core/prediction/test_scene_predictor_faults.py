# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One road user's bad data changes no other's prediction; overload has its limits."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.finite_output import publishable
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.schema import Source, tracked_states
from mtpgo_core.task.model_file import find_model

BAD = 2
"""Row of the road user at fault."""


@pytest.fixture(scope="module")
def runner():
    """The shipped model: its graphs, contexts and trails let road users influence each other."""
    return ModelRunner.load(find_model("default"))


def traffic(time_s, n=6):
    """Vehicles in two lanes, 15 m apart, with everything known."""
    row = np.arange(n)
    return tracked_states(
        1 + round(time_s * 1e9),
        "map",
        keys_from_integers(range(1, n + 1)),
        np.stack([15.0 * row + 8.0 * time_s, 3.5 * (row % 2)], axis=1),
        agent_class=np.ones(n, np.uint8),
        z=np.zeros(n),
        velocity=np.tile([8.0, 0.0], (n, 1)),
        yaw=np.zeros(n),
        size=np.tile([4.5, 1.8], (n, 1)),
        covariance=np.tile(0.1 * np.eye(4), (n, 1, 1)),
    )


def spoilt(states, name, value):
    array = getattr(states, name).copy()
    array[BAD] = value
    return dataclasses.replace(states, **{name: array})


def without(states, row=BAD):
    keep = np.arange(len(states)) != row
    arrays = {k: v[keep] for k, v in vars(states).items() if isinstance(v, np.ndarray)}
    return dataclasses.replace(states, **arrays)


def predicted(runner, change, **options):
    """The prediction after one second of traffic whose observations are changed from 0.6 s on."""
    predictor = ScenePredictor(runner, options=PredictorOptions(**options))
    history = TrackHistory(predictor.task.history)
    for step in range(11):
        states = traffic(0.1 * step)
        history.update(change(states) if step > 5 else states)
    return predictor.predict(history.window())


REJECTED = [
    ("position", np.nan),
    ("position", np.inf),
    ("position", 1e39),
    ("velocity", 1e4),
    ("velocity", -1e300),
]
UNKNOWN = [
    (name, value)
    for name in ("acceleration", "yaw", "size", "z")
    for value in (np.inf, 1e39, -1e39)
] + [("covariance", value) for value in (np.inf, 0.0, -1.0, 1.0, 1e38, 1e-320)]


@pytest.mark.parametrize(("name", "value"), REJECTED)
def test_a_rejected_observation_is_as_none(runner, name, value):
    found = predicted(runner, lambda states: spoilt(states, name, value))
    missing = predicted(runner, without)
    assert publishable(found).all()
    np.testing.assert_array_equal(found.mean, missing.mean)
    np.testing.assert_array_equal(found.covariance, missing.covariance)


@pytest.mark.parametrize(("name", "value"), UNKNOWN)
def test_a_bad_value_is_as_an_unknown_one(runner, name, value):
    options = {"use_tracker_covariance": True}
    found = predicted(runner, lambda states: spoilt(states, name, value), **options)
    unknown = predicted(runner, lambda states: spoilt(states, name, np.nan), **options)
    assert publishable(found).all()
    others = np.arange(6) != BAD
    np.testing.assert_array_equal(found.mean[others], unknown.mean[others])
    np.testing.assert_array_equal(found.covariance[others], unknown.covariance[others])


def test_the_nearest_are_predicted_by_the_model_and_the_heaviest_modes_kept(runner):
    predictor = ScenePredictor(runner, options=PredictorOptions(max_agents=10, max_points=2500))
    history = TrackHistory(predictor.task.history)
    for step in range(5):
        history.update(traffic(0.2 * step, 40))
    found = predictor.predict(history.window())
    assert publishable(found).all()
    assert found.mean.shape[:2] == (40, 2)  # 40 x 2 x 25 points are below 2500
    assert np.flatnonzero(found.source == Source.MODEL).tolist() == list(range(15, 25))
    assert predictor.fallback(history.window()).mean.shape == found.mean.shape
    assert predictor.last_report.modes == 2


def test_a_model_that_takes_too_long_gets_fewer_agents_and_then_all_again(runner):
    predictor = ScenePredictor(runner)
    history = TrackHistory(predictor.task.history)
    history.update(traffic(0.0, 40))
    predictor.allowed_s = 1e-6
    predictor.predict(history.window())
    assert predictor.last_report.agent_limit == 8
    found = predictor.predict(history.window())
    assert (found.source == Source.MODEL).sum() == 8
    assert predictor.last_report.over_limit == 32
    predictor.allowed_s = 60.0
    for _ in range(30):
        found = predictor.predict(history.window())
    assert (found.source == Source.MODEL).all()
    assert predictor.last_report.agent_limit is None
