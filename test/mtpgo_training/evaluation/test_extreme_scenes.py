# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The best and the worst scenes, where both are known."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars, cut_windows

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.evaluation.extreme_scenes import ExtremeScenes
from mtpgo_training.evaluation.scorer import Scorer

H = 10


@pytest.fixture(scope="module")
def recording():
    return braking_cars(tracks=4)


def update(scenes, recording, when, ade, cv, *, whole=True, source=Source.MODEL, age_s=5.0):
    """Offer a prediction of the window ``when`` with given errors."""
    window = cut_windows(recording, HistoryConfig(), 1.0)[when].window
    prediction = predict_constant_velocity(window, horizon_steps=H, dt_s=0.2)
    n = len(prediction)
    prediction = dataclasses.replace(prediction, source=np.full(n, source, np.uint8))
    scorer = Scorer(recording)
    scorer.age_s = lambda track, stamp_ns: np.full(n, age_s)
    scored = scorer.score(prediction)
    truth = scorer.ground_truth(prediction.key, prediction.stamp_ns, H, 0.2)
    scored = dataclasses.replace(
        scored,
        rows=np.ones(n, bool),
        truth=dataclasses.replace(truth, mask=np.full((n, H), whole)),
        scores=dataclasses.replace(scored.scores, values={"ade": np.array(ade)}),
    )
    scenes.update(scorer, prediction, scored, np.array(cv))


def shown(moments):
    return [(m.prediction.key[m.agent, 0], m.interest) for m in moments]


def test_best_gains_the_most_and_worst_has_the_largest_ade(recording):
    scenes = ExtremeScenes()
    update(scenes, recording, 3, [1.0, 3.0, 0.1, 2.0], [4.0, 3.5, 0.2, 1.0])
    assert shown(scenes.best(3)) == [(100, 3.0)]
    assert shown(scenes.worst(3)) == [(101, 3.0)]
    assert scenes.best(1)[0].note == "ADE 1.00 m, constant velocity 4.00 m"
    # Later another road user; and the same one again, which counts only if its interest is larger.
    update(scenes, recording, 8, [0.5, 1.0, 0.1, 9.0], [2.0, 1.0, 7.1, 1.0])
    assert shown(scenes.best(3)) == [(102, 7.0), (100, 3.0)]
    assert shown(scenes.worst(3)) == [(103, 9.0), (101, 3.0)]


def test_only_whole_futures_of_the_model_count(recording):
    scenes = ExtremeScenes()
    values = ([1.0] * 4, [4.0] * 4)
    update(scenes, recording, 3, *values, whole=False)
    update(scenes, recording, 3, *values, source=Source.CONSTANT_VELOCITY)
    assert scenes.best(3) == scenes.worst(3) == []
    update(scenes, recording, 3, *values, age_s=1.0)  # without a past to show
    assert scenes.best(3) == []
    assert len(scenes.worst(3)) == 1


def test_scenes_of_several_processes_are_merged(recording):
    whole, parts = ExtremeScenes(), [ExtremeScenes(), ExtremeScenes()]
    for i, when in enumerate((1, 7)):
        values = ([1.0 + i, 0.2, 0.3, 0.4], [2.0, 0.3, 5.0 * i, 0.4])
        for scenes in (whole, parts[i]):
            update(scenes, recording, when, *values)
    parts[0].merge(parts[1])
    assert shown(parts[0].best(3)) == shown(whole.best(3))
    assert shown(parts[0].worst(3)) == shown(whole.worst(3))


def test_few_are_kept(recording):
    scenes = ExtremeScenes()
    for i in range(30):
        named = dataclasses.replace(recording, name=f"{i}")
        update(scenes, named, 3, [1.0 + i, 0.0, 0.0, 0.0], [40.0, 0.0, 0.0, 0.0])
    assert len(scenes._best) == len(scenes._worst) == 12
    assert shown(scenes.worst(1)) == [(100, 30.0)]
    assert shown(scenes.best(1)) == [(100, 39.0)]
