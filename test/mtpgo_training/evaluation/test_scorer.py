# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions matched to a recording by key and stamp."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars, cut_windows

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import with_time_origin
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.evaluation.scorer import Scorer, add_scores
from mtpgo_training.evaluation.scores.agent_scores import KEYS
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.kinematic_baselines import predict_baselines

H, DT = 10, 0.2


def windows(recording):
    return cut_windows(recording, HistoryConfig(), 1.0)


def predictions(recording):
    return [
        predict_constant_velocity(w.window.select(w.window.valid[:, -1]), horizon_steps=H, dt_s=DT)
        for w in windows(recording)
    ]


def score(predictions, recording, **options):
    """Averages of predictions and baselines under the protocol ``all``."""
    table = ScoreTable()
    add_scores(table, predictions, recording, **options)
    return {name: protocols["all"] for name, protocols in table.averages().items()}


def test_constant_velocity_scores_as_the_baseline():
    recording = braking_cars(tracks=6)
    scores = score(predictions(recording)[::-1], recording)
    for key in KEYS:
        assert scores["model"][key] == pytest.approx(scores["cv"][key], abs=1e-9)
    assert scores["model"]["n"] == scores["cv"]["n"] > 30


def test_scores_equal_a_loop_over_agents():
    recording = braking_cars(tracks=5)
    errors, finals = [], []
    future = FutureTable(recording)
    for tracked in windows(recording):
        path = predict_baselines(tracked.window, H, DT)["cv"].position
        truth = future.at(tracked.track, tracked.window.stamp_ns, H, DT)
        for i in range(len(tracked.track)):
            if tracked.window.valid[i, -1] and truth.known[i].any():
                distance = np.linalg.norm(path[i] - truth.position[i], axis=-1)
                errors.append(distance[truth.known[i]].mean())
                if truth.known[i, -1]:
                    finals.append(distance[-1])
    scores = score(predictions(recording), recording)["model"]
    assert scores["ade"] == pytest.approx(np.mean(errors))
    assert scores["fde"] == pytest.approx(np.mean(finals))
    assert (scores["n"], scores["n_final"]) == (len(errors), len(finals))


def test_the_truth_itself_scores_zero_and_unmatched_predictions_do_not_count():
    recording = braking_cars(tracks=5)
    future = FutureTable(recording)
    perfect = []
    for tracked, given in zip(windows(recording), predictions(recording), strict=True):
        track = tracked.track[tracked.window.valid[:, -1]]
        truth = future.at(track, given.stamp_ns, H, DT)
        mean = given.mean.copy()
        mean[:, 0, :, :2] = truth.position
        perfect.append(dataclasses.replace(given, mean=mean))
    unmatched = dataclasses.replace(
        perfect[0], key=keys_from_integers(range(9000, 9000 + len(perfect[0])))
    )
    scores = score([*perfect, unmatched], recording)["model"]
    assert scores["ade"] == pytest.approx(0.0, abs=1e-9)
    assert scores["mr"] == 0.0
    assert scores["n"] == score(perfect, recording)["model"]["n"]


def test_a_least_future_leaves_agents_out():
    recording = braking_cars(tracks=5)
    scores = [
        score(predictions(recording), recording, min_future_s=min_future_s)["model"]
        for min_future_s in (0.0, H * DT)
    ]
    assert scores[1]["n"] == scores[1]["n_final"] == scores[0]["n_final"] < scores[0]["n"]


def test_the_truth_says_who_the_agents_are():
    recording = braking_cars(tracks=3)
    prediction = predictions(recording)[4]
    truth = Scorer(recording).ground_truth(prediction.key, prediction.stamp_ns, H, DT)
    agents = truth.agents
    assert (agents.recording, agents.site) == (recording.name, recording.location)
    assert recording.track_id[agents.track].tolist() == prediction.key[:, 0].tolist()
    speed = np.linalg.norm(prediction.initial[:, 2:], axis=1)
    np.testing.assert_allclose(agents.speed_mps, speed, rtol=1e-6)
    assert agents.since_start_s == pytest.approx(
        1e-9 * prediction.stamp_ns - 1e-9 * recording.stamp_ns(int(recording.frames[0]))
    )
    unknown = Scorer(recording).ground_truth(
        keys_from_integers([9000]), prediction.stamp_ns, H, DT
    )
    assert unknown.agents.track.tolist() == [-1]
    assert np.isnan(unknown.agents.speed_mps).all()
    assert not unknown.mask.any()


def test_baselines_are_scored_for_the_agents_in_the_window():
    recording = braking_cars(tracks=4)
    tracked, prediction = windows(recording)[5], predictions(recording)[5]
    scorer = Scorer(recording)
    found = scorer.score(prediction)
    whole = scorer.score_baselines(tracked.window, found.truth)
    assert whole.rows.all()
    assert set(whole.scores) == {"cv", "ca", "ctrv"}
    some = scorer.score_baselines(tracked.window.select(np.array([2, 0])), found.truth)
    first = recording.find_tracks(tracked.window.key[[0, 2]])
    np.testing.assert_array_equal(some.rows, np.isin(found.truth.agents.track, first))
    np.testing.assert_array_equal(some.cv_ade[some.rows], whole.cv_ade[some.rows])
    assert np.isnan(some.cv_ade[~some.rows]).all()


def test_with_a_compensated_delay_truth_and_baselines_begin_later():
    """A node that starts its horizon at the present publishes the delay and one step first."""
    recording = braking_cars(tracks=6)
    delay_ns = 50_000_000  # between two frames
    history, delayed = HistoryConfig(), []
    stamps = [w.window.stamp_ns for w in windows(recording)]
    for window in replay(recording, history, stamps, ahead_ns=[delay_ns] * len(stamps)):
        constant = predict_constant_velocity(
            window.select(window.valid[:, -1]), horizon_steps=H, dt_s=DT
        )
        delayed.append(with_time_origin(constant, window.stamp_ns - delay_ns))
    assert [one.stamp_ns for one in delayed] == stamps
    scores = score(delayed, recording)
    for key in KEYS:
        assert scores["model"][key] == pytest.approx(scores["cv"][key], abs=1e-9)
    plain = score(predictions(recording), recording)["cv"]
    assert scores["cv"]["ade"] == pytest.approx(plain["ade"], rel=0.1)


def test_no_predictions_give_an_empty_table():
    assert score([], braking_cars(tracks=2)) == {}


def test_time_counts_from_the_start_of_a_part():
    """A model that runs on a part has seen nothing of what was before."""
    whole = braking_cars(tracks=3)
    prediction = predictions(whole)[6]
    since_s = [
        Scorer(one).ground_truth(prediction.key, prediction.stamp_ns, H, DT).agents.since_start_s
        for one in (whole, whole.between(2.0))
    ]
    assert since_s[0] - since_s[1] == pytest.approx(2.0, abs=1.0 / whole.frame_rate)
