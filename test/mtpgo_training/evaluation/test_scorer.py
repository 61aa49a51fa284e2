# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions matched to a recording by key and stamp."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.identity import keys_from_integers
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.evaluation.scorebook import KEYS, ScoreBook
from mtpgo_training.evaluation.scorer import add_scores, score
from mtpgo_training.scenes.kinematic_baselines import constant_velocity
from mtpgo_training.scenes.windows import cut_windows

H, DT = 10, 0.2


def windows(recording):
    return cut_windows(recording, HistoryConfig(), 1.0)


def predictions(recording):
    return [
        predict_constant_velocity(w.window.select(w.window.valid[:, -1]), horizon_steps=H, dt_s=DT)
        for w in windows(recording)
    ]


def test_constant_velocity_scores_as_the_baseline_beside_it():
    recording = braking_cars(tracks=6)
    table = score(predictions(recording)[::-1], recording)
    for key in KEYS:
        assert table.models["model"]["all"][key] == pytest.approx(
            table.models["cv"]["all"][key], abs=1e-9, nan_ok=True
        )
    assert table.models["model"]["all"]["n"] == table.models["cv"]["all"]["n"] > 30


def test_scores_equal_a_loop_over_agents():
    recording = braking_cars(tracks=5)
    errors, finals = [], []
    future = FutureTable(recording)
    for tracked in windows(recording):
        path = constant_velocity(tracked.window, H, DT)
        truth = future.at(tracked.track, tracked.window.stamp_ns, H, DT)
        for i in range(len(tracked.track)):
            if tracked.window.valid[i, -1] and truth.known[i].any():
                distance = np.linalg.norm(path[i] - truth.position[i], axis=-1)
                errors.append(distance[truth.known[i]].mean())
                if truth.known[i, -1]:
                    finals.append(distance[-1])
    scores = score(predictions(recording), recording).models["model"]["all"]
    assert scores["ade"] == pytest.approx(np.mean(errors))
    assert scores["fde"] == pytest.approx(np.mean(finals))
    assert (scores["n"], scores["n_final"]) == (len(errors), len(finals))


def test_the_truth_itself_scores_zero_and_strangers_do_not_count():
    recording = braking_cars(tracks=5)
    future = FutureTable(recording)
    perfect = []
    for tracked, given in zip(windows(recording), predictions(recording), strict=True):
        track = tracked.track[tracked.window.valid[:, -1]]
        truth = future.at(track, given.stamp_ns, H, DT)
        mean = given.mean.copy()
        mean[:, 0, :, :2] = truth.position
        perfect.append(dataclasses.replace(given, mean=mean))
    stranger = dataclasses.replace(
        perfect[0], key=keys_from_integers(range(9000, 9000 + len(perfect[0])))
    )
    scores = score([*perfect, stranger], recording).models["model"]["all"]
    assert scores["ade"] == pytest.approx(0.0, abs=1e-9)
    assert scores["mr"] == 0.0
    assert scores["n"] == score(perfect, recording).models["model"]["all"]["n"]


def test_a_least_future_leaves_agents_out():
    recording = braking_cars(tracks=5)
    scores = []
    for min_future_s in (0.0, H * DT):
        book = ScoreBook()
        add_scores(book, predictions(recording), recording, min_future_s=min_future_s)
        scores.append(book.table().models["model"]["all"])
    assert scores[1]["n"] == scores[1]["n_final"] == scores[0]["n_final"] < scores[0]["n"]


def test_the_text_has_a_line_a_model():
    recording = braking_cars(tracks=3, seconds=4.0)
    lines = score(predictions(recording), recording, name="mine").text().splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["mine", "cv", "ca", "ctrv"]
    assert "ADE m" in lines[0]
    assert len({len(line) for line in lines}) == 1


def test_no_predictions_give_an_empty_table():
    assert score([], braking_cars(tracks=2)).models == {}
