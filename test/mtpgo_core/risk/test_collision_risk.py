# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Risks of whole predictions: mixtures, times, bounds, and what is unknown."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.errors import FrameError
from mtpgo_core.frames import Pose2
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.risk.collision_risk import QUANTILES, Unknown, assess
from mtpgo_core.risk.ego_plan import EgoFootprint, make_plan, plan_of_motion
from mtpgo_core.risk.footprint_overlap import overlap_probability
from mtpgo_core.schema import AgentClass, Prediction

START = 1_700_000_000_000_000_000
BOX = EgoFootprint(length=4.0, width=2.0)
STILL = plan_of_motion(START, "map", Pose2(0.0, 0.0, 0.0))


def prediction(x, y=0.0, *, weight=(1.0,), sigma_m=1.0, **changes):
    """Return agents [n] with modes that stand at places x [n, M] over three steps."""
    x = np.atleast_2d(np.array(x, float))
    n, modes = x.shape
    mean = np.zeros((n, modes, 3, 4))
    mean[..., 0], mean[..., 1] = x[..., None], y
    made = Prediction(
        stamp_ns=START,
        frame_id="map",
        key=keys_from_integers(range(1, n + 1)),
        agent_class=np.full(n, AgentClass.CAR, np.uint8),
        z=np.zeros(n),
        size=np.tile([4.0, 2.0], (n, 1)),
        initial=np.full((n, 4), np.nan),
        initial_yaw=np.zeros(n),
        time_s=np.array([0.5, 1.0, 1.5]),
        weight=np.tile(weight, (n, 1)),
        mean=mean,
        yaw=np.zeros((n, modes, 3)),
        covariance=np.broadcast_to(sigma_m**2 * np.eye(2), (n, modes, 3, 2, 2)).copy(),
        source=np.zeros(n, np.uint8),
    )
    return dataclasses.replace(made, **changes)


def one(x, sigma_m=1.0):
    """Return the probability of one Gaussian at (x, 0)."""
    two = np.array([[4.0, 2.0]])
    return overlap_probability(
        np.array([[x, 0.0]]), sigma_m**2 * np.eye(2)[None], np.zeros(1), np.zeros(1), two, two
    )[0]


def test_modes_count_with_their_weights():
    risk = assess(prediction([[3.0, 5.0]], weight=(0.7, 0.3)), STILL, BOX)
    np.testing.assert_allclose(risk.probability, 0.7 * one(3.0) + 0.3 * one(5.0), rtol=1e-9)
    assert (risk.unknown == Unknown.KNOWN).all()
    assert risk.agent_unknown.tolist() == [Unknown.KNOWN]


def test_the_highest_risk_has_its_time_and_modes_may_be_dangerous_at_different_times():
    given = prediction([[0.0, 0.0]], weight=(0.5, 0.5))
    given.mean[0, :, :, 0] = [[9.0, 3.0, 9.0], [9.0, 9.0, 4.0]]
    risk = assess(given, STILL, BOX)
    assert risk.peak_step.tolist() == [1]
    assert risk.peak_time_s.tolist() == [1.0]
    assert risk.peak[0] == pytest.approx(0.5 * one(3.0) + 0.5 * one(9.0))
    # Whichever mode it is, the ego is met: at least by each mode's own worst moment.
    assert risk.at_least[0] == pytest.approx(0.5 * one(3.0) + 0.5 * one(4.0))
    assert (risk.at_least >= risk.peak - 1e-12).all()


def test_the_ego_moves_along_its_plan_with_the_middle_of_its_box():
    moving = make_plan(
        START,
        "map",
        START + np.array([0, 2_000_000_000], dtype=np.int64),
        np.array([[0.0, 0.0], [20.0, 0.0]]),
        np.zeros(2),
    )
    box = dataclasses.replace(BOX, center_offset=1.0)
    risk = assess(prediction([[11.0]], sigma_m=0.3), moving, box)
    # The middle of the box is at 6, 11 and 16 m.
    np.testing.assert_allclose(risk.probability, [[one(5.0, 0.3), 1.0, one(5.0, 0.3)]], atol=1e-6)


def test_distances_are_quantiles_of_the_smallest_one():
    risk = assess(prediction([[14.0]], sigma_m=1.0), STILL, BOX)
    assert QUANTILES == (0.05, 0.5, 0.95)
    # One dimension counts: 10 m between the boxes, standard deviation 1 m.
    np.testing.assert_allclose(risk.distance_m[0], [10.0 - 1.645, 10.0, 10.0 + 1.645], atol=0.3)


def test_a_size_that_is_not_known_is_that_of_the_class():
    risk = assess(prediction([[6.0]], size=np.full((1, 2), np.nan)), STILL, BOX)
    np.testing.assert_allclose(risk.size, [[4.5, 1.8]])


def test_without_a_plan_every_risk_is_unknown():
    for reason in (Unknown.NO_PLAN, Unknown.STALE):
        risk = assess(prediction([[0.0], [50.0]]), None, BOX, reason=reason)
        for values in (risk.probability, risk.peak, risk.peak_time_s, risk.at_least):
            assert np.isnan(values).all()
        assert np.isnan(risk.distance_m).all()
        assert (risk.unknown == reason).all()
        assert risk.agent_unknown.tolist() == [reason, reason]


def test_a_plan_in_another_frame_is_refused():
    with pytest.raises(FrameError, match="in the frame 'odom' and the predictions in 'map'"):
        assess(prediction([[0.0]]), plan_of_motion(START, "odom", Pose2(0.0, 0.0, 0.0)), BOX)


def test_beyond_the_end_of_the_plan_the_risk_is_unknown():
    short = make_plan(
        START,
        "map",
        START + np.array([0, 1_000_000_000], dtype=np.int64),
        np.zeros((2, 2)),
        np.zeros(2),
    )
    risk = assess(prediction([[3.0]]), short, BOX)
    assert risk.unknown.tolist() == [[Unknown.KNOWN, Unknown.KNOWN, Unknown.BEYOND_PLAN]]
    assert np.isnan(risk.probability[0]).tolist() == [False, False, True]
    assert risk.known_steps.tolist() == [2]
    assert risk.agent_unknown.tolist() == [Unknown.PARTLY]
    assert risk.peak[0] == pytest.approx(one(3.0))


@pytest.mark.parametrize("field", ["mean", "yaw", "covariance", "weight"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_mode_that_is_not_finite_makes_its_agent_unknown_but_no_other(field, value):
    given = prediction([[3.0, 4.0], [3.0, 4.0]], weight=(0.5, 0.5))
    getattr(given, field)[0, 1] = value
    risk = assess(given, STILL, BOX)
    assert (risk.unknown[0] == Unknown.NO_PREDICTION).all()
    assert risk.agent_unknown.tolist() == [Unknown.NO_PREDICTION, Unknown.KNOWN]
    assert np.isnan(risk.peak[0])
    assert np.isfinite(risk.peak[1])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("mean", 1e9),
        ("mean", 1e38),
        ("mean", [1e9, 0.0, 0.0, 0.0]),
        ("mean", [0.0, 1e9, 0.0, 0.0]),
        ("yaw", 1e6),
        ("covariance", 2e8 * np.eye(2)),
        ("covariance", 1e38 * np.eye(2)),
    ],
)
def test_numbers_beyond_belief_are_unknown_and_not_a_low_risk(field, value):
    given = prediction([[3.0], [3.0]])
    getattr(given, field)[0] = value
    risk = assess(given, STILL, BOX)
    assert risk.agent_unknown.tolist() == [Unknown.NO_PREDICTION, Unknown.KNOWN]
    assert np.isnan(risk.peak).tolist() == [True, False]
    assert np.isnan(risk.distance_m[0]).all()
    assert not (np.abs(risk.position) > 1e8).any()  # displays draw it
    assert risk.peak[1] == pytest.approx(one(3.0))


def test_modes_that_were_filtered_away_are_not_taken_for_safety():
    risk = assess(prediction([[90.0, 95.0]], weight=(0.5, 0.2)), STILL, BOX)
    assert risk.agent_unknown.tolist() == [Unknown.NO_PREDICTION]
    assert np.isnan(risk.probability).all()


def test_a_mode_without_weight_may_be_anything():
    given = prediction([[3.0, np.nan]], weight=(1.0, 0.0))
    risk = assess(given, STILL, BOX)
    np.testing.assert_allclose(risk.probability, one(3.0))


def test_a_step_that_is_missing_leaves_the_others():
    given = prediction([[3.0]])
    given.mean[0, 0, 1] = np.nan
    risk = assess(given, STILL, BOX)
    assert risk.unknown.tolist() == [[0, Unknown.NO_PREDICTION, 0]]
    assert risk.agent_unknown.tolist() == [Unknown.PARTLY]


def test_a_prediction_without_steps_is_unknown():
    given = prediction([[3.0]])
    names = ("mean", "yaw", "covariance")
    none = {name: getattr(given, name)[:, :, :0] for name in names}
    risk = assess(dataclasses.replace(given, time_s=np.empty(0), **none), STILL, BOX)
    assert np.isnan([risk.peak[0], risk.peak_time_s[0], risk.at_least[0]]).all()
    assert (risk.known_steps.tolist(), risk.probability.shape) == ([0], (1, 0))


def test_no_agents():
    risk = assess(prediction(np.empty((0, 2)), weight=(0.5, 0.5)), STILL, BOX)
    assert len(risk) == 0
    assert risk.probability.shape == (0, 3)
    assert risk.distance_m.shape == (0, len(QUANTILES))
