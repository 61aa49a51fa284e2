# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's scores without ROS: predictions come from other threads."""

import threading

import numpy as np
from ros_helpers import traffic

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.quality.live_quality import LiveQuality


def drive(quality, history, times_s, publish):
    for time_s in times_s:
        quality.observed(history, history.update(traffic(time_s)))
        window = history.window()
        prediction = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2)
        publish(prediction, window)


def test_predictions_of_another_thread_are_scored():
    quality, history = LiveQuality(HistoryConfig()), TrackHistory(HistoryConfig())

    def publish(prediction, window):
        thread = threading.Thread(target=quality.published, args=(prediction, window, None))
        thread.start()
        thread.join()

    drive(quality, history, 0.2 * np.arange(30), publish)
    report = quality.report()
    assert report.predictions[0].sum(axis=0).tolist() == [4 * 25, 4 * 15, 4 * 5]
    assert report.by_model.sum() == 0  # constant velocity
    assert report.agents.max() == 4
    assert quality.frame_id == "map"
    assert np.nanmax(report.scores[..., 0]) < 1e-4


def test_after_the_clock_was_set_back_nothing_is_in_flight():
    quality, history = LiveQuality(HistoryConfig()), TrackHistory(HistoryConfig())
    drive(
        quality, history, 0.2 * np.arange(6), lambda p, window: quality.published(p, window, None)
    )
    history.clear()
    quality.clear()
    before = quality.report().predictions.sum()
    for time_s in 0.2 * np.arange(40) - 20.0:
        quality.observed(history, history.update(traffic(time_s)))
    assert quality.report().predictions.sum() == before
    assert quality.report().unknown["clock_reset"] > 0
