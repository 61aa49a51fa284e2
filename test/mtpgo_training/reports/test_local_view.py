# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The surroundings of a moment, in the frame of the road user in focus."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction

from mtpgo_training.evaluation.moments import Moment, choose_moments
from mtpgo_training.reports.local_view import surroundings


@pytest.fixture
def recording():
    return make_recording()


def test_surroundings_are_in_the_frame_of_the_focal_road_user(recording):
    prediction = perfect_prediction(recording, 60)
    (moment,) = choose_moments([(recording, [prediction])], 1)
    around = surroundings(moment, past_s=3.0)
    # At 6 s car 8 has turned by 0.6 rad; it is at the origin, heading along +x at 10 m/s.
    assert around.angle == pytest.approx(0.6)
    np.testing.assert_allclose(around.position[1], 0.0, atol=1e-9)
    np.testing.assert_allclose(around.velocity[1], [10.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(around.yaw, [-0.6, 0.0], atol=1e-9)
    assert [len(path) for path in around.past] == [31, 31]
    assert [len(path) for path in around.future] == [51, 51]
    np.testing.assert_allclose(
        around.turn(prediction.mean[1, 0, -1, :2]), around.future[1][-1], atol=1e-9
    )
    # Turned by a right angle, the long axis of an ellipse along x is along -y.
    turned = surroundings(moment, past_s=3.0).turn_covariance(np.diag([4.0, 1.0]))
    assert np.trace(turned) == pytest.approx(5.0)
    expected = 4.0 * np.cos(0.6) ** 2 + np.sin(0.6) ** 2
    assert turned[0, 0] == pytest.approx(expected)


def test_without_a_yaw_the_heading_is_that_of_the_velocity(recording):
    prediction = perfect_prediction(recording, 60)
    unknown = dataclasses.replace(recording, yaw=np.full(len(recording), np.nan))
    views = [
        surroundings(Moment(own, prediction, 1, 1.0), past_s=3.0) for own in (recording, unknown)
    ]
    np.testing.assert_allclose(views[1].yaw, views[0].yaw, atol=1e-9)
    assert views[1].angle == pytest.approx(0.6)


def test_the_past_and_the_future_end_with_the_recording(recording):
    # 1 s after the first and 1 s before the last frame, at 10 Hz, both ends included.
    for frame, past, future in ((10, 11, 51), (110, 31, 11)):
        moment = Moment(recording, perfect_prediction(recording, frame), 0, 1.0)
        around = surroundings(moment, past_s=3.0)
        assert [len(path) for path in around.past] == [past, past]
        assert [len(path) for path in around.future] == [future, future]
        np.testing.assert_allclose(around.past[0][-1], around.future[0][0])
        assert [len(path) for path in around.paths] == [121, 121]
