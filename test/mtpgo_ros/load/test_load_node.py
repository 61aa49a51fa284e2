# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the load generator's node records of the predictions that it receives."""

import numpy as np
import pytest
from ros_helpers import START_NS, traffic

from msg_adapters.registry import output_adapter
from msg_adapters.types import RclpyTypes
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.load.load_node import LoadNode


@pytest.fixture
def node():
    one = LoadNode(agents=3, predictor="/robot/predictor", markers=False)
    yield one
    one.destroy_node()


def test_a_prediction_is_recorded_with_its_agents_and_those_at_constant_velocity(node):
    history = TrackHistory(HistoryConfig())
    history.update(traffic(0.0, 4))
    prediction = predict_constant_velocity(history.window(), horizon_steps=5, dt_s=0.2, modes=2)
    prediction.source[:3] = Source.MODEL
    writer = output_adapter("pointcloud2").writer(RclpyTypes(), max_modes=2, serialized=False)
    node._on_prediction(writer(prediction))
    ((stamp_ns, received_ns, agents, fallback),) = node.result()["received"]
    assert (stamp_ns, agents, fallback) == (START_NS, 4, 1)
    assert received_ns > 0


def test_every_observation_is_recorded_with_its_stamp_and_time(node):
    for step in range(3):
        node.publish(0.1 * step, START_NS + step)
    stamps, times = np.array(node.result()["published"]).T
    assert stamps.tolist() == [START_NS, START_NS + 1, START_NS + 2]
    assert (np.diff(times) >= 0).all()
    assert node.result()["heard_from_stamp"] is None  # there is no subscriber
