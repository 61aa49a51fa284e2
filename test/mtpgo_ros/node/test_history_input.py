# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From observation to work, without ROS and without a model."""

import dataclasses

import pytest
from ros_helpers import START_NS, traffic

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.scene_predictor import ScenePredictor
from mtpgo_ros.diagnostics.counters import Statistics
from mtpgo_ros.node.history_input import Intake
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters


@pytest.fixture
def make():
    def make(**values):
        parameters = dataclasses.replace(PredictorParameters(), **values)
        statistics = Statistics()
        pipeline = ScenePredictor(None)
        return (
            Intake(TrackHistory(pipeline.task.history), pipeline, statistics, parameters),
            statistics,
            pipeline,
        )

    return make


def at(time_s):
    return START_NS + round(time_s * 1e9)


def test_due_observations_give_a_window_at_their_time(make):
    intake, statistics, _ = make()
    works = [intake.take(traffic(k / 10), at(k / 10)) for k in range(5)]
    assert [work is not None for work in works] == [True, False, True, False, True]
    assert works[4].stamp_ns == works[4].window.stamp_ns == at(0.4)
    assert works[4].window.valid[:, -3:].all()
    assert not works[4].window.valid[:, :-3].any()
    assert not statistics.counts()


def test_delay_compensation_takes_the_window_at_the_present_time(make):
    intake, statistics, pipeline = make(delay_compensation=True)
    work = intake.take(traffic(0.0), at(0.3))
    assert work.window.stamp_ns - work.stamp_ns == 300_000_000
    assert work.window.position[:, -1, 0] == pytest.approx([3.0, 15.0, 27.0, 39.0])
    prediction = work.stamped(pipeline.predict(work.window))
    assert prediction.stamp_ns == at(0.0)
    assert prediction.time_s[:2] == pytest.approx([0.5, 0.7])
    assert prediction.mean[0, 0, :2, 0] == pytest.approx([5.0, 7.0])
    # A clock behind the stamp gives no negative delay, one far ahead gives none at all.
    assert intake.take(traffic(1.0), at(0.9)).window.stamp_ns == at(1.0)
    assert intake.take(traffic(2.0), at(2.6)).window.stamp_ns == at(2.0)
    assert statistics.counts() == {"delay_not_compensated": 1}


def test_a_node_without_time_takes_stamps_as_they_are(make):
    intake, statistics, _ = make(delay_compensation=True)
    assert intake.take(traffic(0.0), 0).window.stamp_ns == at(0.0)
    assert not statistics.counts()


def test_the_clocks_jump_back_forgets_what_lies_ahead_of_it(make):
    intake, statistics, _ = make()
    for k in range(10):
        intake.take(traffic(k / 5), at(k / 5))
    intake.clock_jumped_back(at(1.5))  # within the tolerance: the history knows better
    assert intake._history.newest_stamp_ns == at(1.8)
    intake.clock_jumped_back(at(0.0))
    assert intake._history.newest_stamp_ns is None
    work = intake.take(traffic(0.1), at(0.1))
    assert work.window.valid[:, -1].all()
    assert not work.window.valid[:, :-1].any()
    assert statistics.counts() == {"clock_reset": 1}


def test_a_new_rate_counts_from_the_next_observation(make):
    intake, _, _ = make()
    assert intake.take(traffic(0.0), at(0.0)) is not None
    assert intake.take(traffic(0.1), at(0.1)) is None
    intake.configure(dataclasses.replace(PredictorParameters(), rate=10.0))
    assert intake.take(traffic(0.2), at(0.2)) is not None
    assert intake.take(traffic(0.3), at(0.3)) is not None
