# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Best and worst, where both are known."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.evaluation.extreme_scenes import SceneKeeper
from mtpgo_training.scenes.windows import cut_windows

H = 10


@pytest.fixture(scope="module")
def recording():
    return braking_cars(tracks=4)


def offer(keeper, recording, when, ade, cv, *, whole=True, source=Source.MODEL, age_s=5.0):
    window = cut_windows(recording, HistoryConfig(), 1.0)[when].window
    prediction = predict_constant_velocity(window, horizon_steps=H, dt_s=0.2)
    n = len(prediction)
    prediction = dataclasses.replace(prediction, source=np.full(n, source, np.uint8))
    keeper.offer(
        recording,
        prediction,
        np.ones(n, bool),
        np.full((n, H), whole),
        np.array(ade),
        np.array(cv),
        np.full(n, age_s),
    )


def shown(moments):
    return [(m.prediction.key[m.agent, 0], m.interest) for m in moments]


def test_best_gains_the_most_and_worst_is_the_farthest_off(recording):
    keeper = SceneKeeper()
    offer(keeper, recording, 3, [1.0, 3.0, 0.1, 2.0], [4.0, 3.5, 0.2, 1.0])
    assert shown(keeper.best(3)) == [(100, 3.0)]
    assert shown(keeper.worst(3)) == [(101, 3.0)]
    assert keeper.best(1)[0].note == "ADE 1.00 m, constant velocity 4.00 m"
    # Later, somebody else; and the same road user once more, which counts only if it is more.
    offer(keeper, recording, 8, [0.5, 1.0, 0.1, 9.0], [2.0, 1.0, 7.1, 1.0])
    assert shown(keeper.best(3)) == [(102, 7.0), (100, 3.0)]
    assert shown(keeper.worst(3)) == [(103, 9.0), (101, 3.0)]


def test_only_whole_futures_of_the_model_count(recording):
    keeper = SceneKeeper()
    values = ([1.0] * 4, [4.0] * 4)
    offer(keeper, recording, 3, *values, whole=False)
    offer(keeper, recording, 3, *values, source=Source.CONSTANT_VELOCITY)
    assert keeper.best(3) == keeper.worst(3) == []
    offer(keeper, recording, 3, *values, age_s=1.0)  # no past to be seen
    assert keeper.best(3) == []
    assert len(keeper.worst(3)) == 1


def test_keepers_of_several_processes_are_one(recording):
    whole, parts = SceneKeeper(), [SceneKeeper(), SceneKeeper()]
    for i, when in enumerate((1, 7)):
        values = ([1.0 + i, 0.2, 0.3, 0.4], [2.0, 0.3, 5.0 * i, 0.4])
        for keeper in (whole, parts[i]):
            offer(keeper, recording, when, *values)
    parts[0].merge(parts[1])
    assert shown(parts[0].best(3)) == shown(whole.best(3))
    assert shown(parts[0].worst(3)) == shown(whole.worst(3))


def test_few_are_kept(recording):
    keeper = SceneKeeper()
    for i in range(30):
        named = dataclasses.replace(recording, name=f"{i}")
        offer(keeper, named, 3, [1.0 + i, 0.0, 0.0, 0.0], [40.0, 0.0, 0.0, 0.0])
    assert len(keeper._best) == len(keeper._worst) == 12
    assert shown(keeper.worst(1)) == [(100, 30.0)]
    assert shown(keeper.best(1)) == [(100, 39.0)]
