# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with plan or predictions makes the risk unknown, with one sentence each."""

import dataclasses

import numpy as np
import pytest
from risk_scene import ERROR, OK, START, WARN, prediction

from msg_adapters.inputs.ego_odometry import EGO_NAME
from mtpgo_core.errors import FrameError, MessageError
from mtpgo_core.frames import Pose2
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.risk.collision_risk import Unknown
from mtpgo_core.risk.ego_plan import make_plan, plan_of_motion
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.input_watch import InputAge
from mtpgo_ros.parameters.risk_parameters import RiskParameters
from mtpgo_ros.risk_node.risk_assessor import RiskAssessor
from mtpgo_ros.risk_node.risk_status import RiskStatus, risk_statuses

STILL = plan_of_motion(START, "map", Pose2(0.0, 0.0, 0.0))


@pytest.fixture
def setup():
    """An assessor and its status."""
    status = RiskStatus(input=InputAge(usable=True))
    return RiskAssessor(RiskParameters(), status, "/plan"), status


def diagnosed(status):
    """Return level and message of the statuses by the last word of their names."""
    found = risk_statuses("risk", status, EventLog())
    return {one.name.split()[-1]: (one.level, one.message) for one in found}


def assert_unknown(risk, reason):
    assert np.isnan(risk.probability).all()
    assert np.isnan(risk.peak).all()
    assert (risk.unknown == reason).all()


def test_with_a_plan_the_risk_is_known_and_the_highest_one_is_named(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    risk = assessor.assess(prediction(), START + 300_000_000)
    assert np.isfinite(risk.probability).all()
    found = diagnosed(status)
    assert {level for level, _ in found.values()} == {OK}
    assert found["result"][1].startswith("highest risk 8")
    assert "(road user 1)" in found["result"][1]


def test_without_a_plan(setup):
    assessor, status = setup
    assert_unknown(assessor.assess(prediction(), START), Unknown.NO_PLAN)
    level, message = diagnosed(status)["plan"]
    assert (level, message) == (ERROR, "no plan has come on /plan yet; the risk is unknown")
    assert diagnosed(status)["result"][0] == ERROR


def test_a_refused_plan_ends_the_one_before_it(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    assessor.assess(prediction(), START)
    assert status.plan_age_s == 0.0
    assessor.refuse_plan(MessageError("path has no times"))
    assert_unknown(assessor.assess(prediction(), START), Unknown.NO_PLAN)
    assert np.isnan(status.plan_age_s)  # not that of the plan before
    assert "the plan on /plan is not usable: path has no times" in diagnosed(status)["plan"][1]
    assessor.add_plan(STILL)
    assert np.isfinite(assessor.assess(prediction(), START).peak).all()
    assert diagnosed(status)["plan"][0] == OK


def test_after_the_clock_was_set_back_no_earlier_plan_is_used(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    assessor.forget_plans()
    assert_unknown(assessor.assess(prediction(), START), Unknown.NO_PLAN)
    sentence = "the clock was set, and no plan has come on /plan since; the risk is unknown"
    assert diagnosed(status)["plan"] == (ERROR, sentence)
    assessor.add_plan(STILL)
    assert np.isfinite(assessor.assess(prediction(), START).peak).all()


@pytest.mark.parametrize("off_s", [-2.5, 2.5])
def test_a_plan_of_another_time(setup, off_s):
    assessor, status = setup
    assessor.add_plan(dataclasses.replace(STILL, stamp_ns=START + round(off_s * 1e9)))
    assert_unknown(assessor.assess(prediction(), START), Unknown.NO_PLAN)
    level, message = diagnosed(status)["plan"]
    assert level == ERROR
    assert "odometry is stale: it was made 2.5 s" in message
    assessor.configure(RiskParameters(plan_timeout=3.0))
    assert np.isfinite(assessor.assess(prediction(), START).peak).all()


def test_a_plan_in_another_frame(setup):
    assessor, status = setup
    assessor.add_plan(plan_of_motion(START, "odom", Pose2(0.0, 0.0, 0.0)))
    assert_unknown(assessor.assess(prediction(), START), Unknown.NO_PLAN)
    level, message = diagnosed(status)["plan"]
    assert level == ERROR
    assert "in the frame 'odom' and the predictions in 'map', expected the same" in message
    # It stays so while plans come, until one can be used.
    assessor.add_plan(plan_of_motion(START, "odom", Pose2(0.0, 0.0, 0.0)))
    assert diagnosed(status)["plan"][0] == ERROR
    assessor.add_plan(STILL)
    assert np.isfinite(assessor.assess(prediction(), START).peak).all()
    assert diagnosed(status)["plan"][0] == OK


def test_a_plan_whose_transform_comes_late():
    """The plan before it is used until it is too old; then the sentence is about the transform."""
    status = RiskStatus(input=InputAge(usable=True))

    def pose_at(frame_id, other, stamp_ns):
        if stamp_ns > START:
            raise FrameError("extrapolation into the future")
        return Pose2(0.0, 0.0, 0.0)

    assessor = RiskAssessor(RiskParameters(), status, "/plan", pose_at)
    for after_ns in (0, 100_000_000):
        assessor.add_plan(plan_of_motion(START + after_ns, "odom", Pose2(0.0, 0.0, 0.0)))
    assert np.isfinite(assessor.assess(prediction(), START).peak).all()
    assert assessor.plan.stamp_ns == START
    assert diagnosed(status)["plan"][0] == OK
    later = prediction(stamp_ns=START + 3_000_000_000)
    assert_unknown(assessor.assess(later, later.stamp_ns), Unknown.NO_PLAN)
    assert "extrapolation into the future" in diagnosed(status)["plan"][1]


def test_predictions_in_a_frame_that_moves(setup):
    assessor, status = setup
    assessor.add_plan(plan_of_motion(START, "base_link", Pose2(0.0, 0.0, 0.0)))
    assert np.isfinite(assessor.assess(prediction(frame_id="base_link"), START).peak).all()
    level, message = diagnosed(status)["predictions"]
    assert level == WARN
    assert "'base_link', which usually moves with the vehicle" in message


def test_a_plan_that_ends_early(setup):
    assessor, status = setup
    times = START + np.array([0, 1_200_000_000], dtype=np.int64)
    assessor.add_plan(make_plan(START, "map", times, np.zeros((2, 2)), np.zeros(2)))
    risk = assessor.assess(prediction(), START)
    assert risk.agent_unknown.tolist() == [Unknown.PARTLY] * 2
    level, message = diagnosed(status)["plan"]
    assert level == WARN
    assert "covers 1 of 2 predicted steps (from 1.0 to 1.0 s)" in message
    assert diagnosed(status)["result"][0] == WARN


@pytest.mark.parametrize(
    ("begin_s", "told"),
    [(1.8, "covers 1 of 2 predicted steps (from 2.0 to 2.0 s)"), (3.0, "covers 0 of 2 predicted")],
)
def test_a_plan_that_begins_late(setup, begin_s, told):
    assessor, status = setup
    times = START + np.array([begin_s * 1e9, 9e9]).astype(np.int64)
    assessor.add_plan(make_plan(START, "map", times, np.zeros((2, 2)), np.zeros(2)))
    assessor.assess(prediction(), START)
    assert told in diagnosed(status)["plan"][1]
    assert "the risk at the others is unknown" in diagnosed(status)["plan"][1]


@pytest.mark.parametrize(("late_s", "side"), [(1.5, "1.5 s old"), (-1.5, "1.5 s ahead of it")])
def test_predictions_of_another_time(setup, late_s, side):
    assessor, status = setup
    assessor.add_plan(STILL)
    now_ns = START + round(late_s * 1e9)
    assert_unknown(assessor.assess(prediction(), now_ns), Unknown.STALE)
    level, message = diagnosed(status)["predictions"]
    assert level == ERROR
    assert side in message
    assert "use_sim_time" in message


def test_a_simulated_clock_that_has_not_begun(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    assert_unknown(assessor.assess(prediction(), 0), Unknown.STALE)
    status.input = InputAge(usable=True, clock_stands_s=5.0, clock_seen=False)
    level, message = diagnosed(status)["predictions"]
    assert level == ERROR
    assert "use_sim_time is set, but no time has come on /clock" in message
    assert "played bag" not in message
    assessor.assess(prediction(), START)
    status.input = InputAge(usable=True, clock_stands_s=5.0)
    level, message = diagnosed(status)["predictions"]
    assert (level, message) == (WARN, "the simulated time on /clock has stood still for 5.0 s")


def test_predictions_that_stop_coming(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    given = prediction()
    assessor.assess(given, START)
    assert_unknown(assessor.expire(given), Unknown.STALE)
    status.topic, status.input = "/predictions", InputAge(usable=True, age_s=2.0)
    level, message = diagnosed(status)["predictions"]
    assert level == ERROR
    assert "the last ones on /predictions came 2.0 s ago" in message


def test_a_road_user_that_is_not_finite(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    given = prediction()
    given.mean[0] = np.nan
    risk = assessor.assess(given, START)
    assert risk.agent_unknown.tolist() == [Unknown.NO_PREDICTION, Unknown.KNOWN]
    level, message = diagnosed(status)["result"]
    assert (level, message) == (ERROR, "the risk of 1 of 2 road users is unknown")
    assert diagnosed(status)["predictions"][0] == OK


def test_a_road_user_without_covariance(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    given = prediction()
    given.covariance[0] = np.nan
    risk = assessor.assess(given, START)
    assert risk.agent_unknown.tolist() == [Unknown.NO_PREDICTION, Unknown.KNOWN]
    level, message = diagnosed(status)["predictions"]
    assert level == WARN
    assert message.startswith("the predictions of 1 of 2 road users have no usable covariance")
    assessor.assess(prediction(), START)
    assert diagnosed(status)["predictions"][0] == OK


def test_the_ego_is_left_out_by_parameter_or_topic(setup):
    assessor, _ = setup
    assert len(assessor.others(prediction())) == 2
    assessor.set_ego("1")
    assert assessor.others(prediction()).key[:, 0].tolist() == [2]
    assessor.configure(RiskParameters(ego_id="2"))
    assert assessor.others(prediction()).key[:, 0].tolist() == [1]


def test_the_ego_that_the_predictor_adds_by_odometry_is_left_out(setup):
    assessor, _ = setup
    given = prediction()
    given.key[0] = keys_from_texts([EGO_NAME])[0]
    assert assessor.others(given).key[:, 0].tolist() == [2]


def test_an_empty_road_is_no_problem(setup):
    assessor, status = setup
    assessor.add_plan(STILL)
    assert len(assessor.assess(prediction(()), START)) == 0
    assert diagnosed(status)["result"] == (OK, "no road user")


def test_the_grid_is_around_the_ego_else_around_the_road_users(setup):
    assessor, _ = setup
    np.testing.assert_allclose(assessor.place(prediction()), [21.5, 0.0])
    assert assessor.place(prediction(())) is None
    assessor.add_plan(plan_of_motion(START, "map", Pose2(5.0, 6.0, 0.0)))
    assessor.assess(prediction(), START)
    np.testing.assert_allclose(assessor.place(prediction()), [5.0, 6.0])


def test_an_inactive_node_says_so():
    found = diagnosed(RiskStatus(state="inactive"))
    assert {level for level, _ in found.values()} == {WARN}
    found = diagnosed(RiskStatus(state="unconfigured", failure="no package"))
    assert {level for level, _ in found.values()} == {ERROR}
    assert "no package" in found["plan"][1]
