# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The selection of moments for pictures, on recordings where one road user turns."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction

from mtpgo_core.schema import Source
from mtpgo_training.evaluation.moments import Moment, _interest, choose, choose_moments


@pytest.fixture
def recording():
    return make_recording()


def played(recording):
    return recording, [perfect_prediction(recording, frame) for frame in range(0, 121, 2)]


def test_the_moment_is_the_one_where_a_car_turns(recording):
    (moment,) = choose_moments([played(recording)], 1)
    assert moment.prediction.key[moment.agent, 0] == 8
    time_s = (moment.prediction.stamp_ns - recording.start_time_ns) * 1e-9
    # The end of the turn is far from the straight path, and 5 s of it are still observed.
    assert 3.0 <= time_s <= 7.0


def test_sites_alternate_and_no_road_user_is_shown_twice():
    one, two = make_recording("a", location="x"), make_recording("b", location="y")
    moments = choose_moments([played(one), played(two)], 4)
    assert [m.recording.name for m in moments] == ["a", "b"]
    assert choose_moments([], 3) == []


def test_sites_alternate_where_folders_number_them_alike():
    def of(recording, frame, agent, interest, site):
        return Moment(recording, perfect_prediction(recording, frame), agent, interest, site=site)

    first, second = make_recording("a", location="1"), make_recording("b", location="1")
    one, more = of(first, 40, 1, 9.0, "a/1"), of(first, 80, 0, 8.0, "a/1")
    other = of(second, 40, 1, 1.0, "b/1")
    assert choose([one, more, other], 2) == [one, other]


def test_interest_weighs_metres_across_more_than_along():
    # At 10 m/s along y for 2 s, 1 km apart: straight on, 1 m aside or ahead, far aside, slow.
    now = np.zeros((5, 4))
    now[:, 0] = 1000.0 * np.arange(5)
    now[:, 3] = [10.0, 10.0, 10.0, 10.0, 2.9]
    end = now[:, :2] + 2.0 * now[:, 2:]
    end[1, 0] += 1.0
    end[2, 1] += 1.0
    end[3, 0] += 50.0
    # Each is its own neighbour: 0.3 m.
    np.testing.assert_allclose(_interest(now, end, 2.0), [0.3, 3.3, 0.6, 60.3, -1.0])


def test_neighbours_within_40_m_add_interest_up_to_ten():
    now = np.tile([0.0, 0.0, 10.0, 0.0], (13, 1))
    now[:2, 0] = [100.0, 139.0]
    interest = _interest(now, now[:, :2] + now[:, 2:], 1.0)
    np.testing.assert_allclose(interest, [0.6, 0.6, *[3.0] * 11])


def test_road_users_observed_too_briefly_or_served_otherwise_are_not_chosen(recording):
    prediction = perfect_prediction(recording, 40)  # 4 s: just before the turn
    assert len(choose_moments([(recording, [prediction])], 1, past_s=4.0)) == 1
    assert choose_moments([(recording, [prediction])], 1, past_s=4.1) == []
    served = np.full(2, Source.CONSTANT_VELOCITY, dtype=np.uint8)
    other = dataclasses.replace(prediction, source=served)
    assert choose_moments([(recording, [other])], 1) == []


def test_moments_of_a_recording_are_of_two_road_users_and_four_seconds_apart(recording):
    def at(frame, agent, interest):
        return Moment(recording, perfect_prediction(recording, frame), agent, interest)

    first = at(40, 1, 9.0)
    near, same, good = at(79, 0, 8.0), at(90, 1, 7.0), at(80, 0, 1.0)
    assert choose([good, same, near, first], 3) == [first, good]
