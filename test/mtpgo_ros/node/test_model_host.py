# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model of the node, its options and what it reports, without ROS."""

import dataclasses

import numpy as np
import pytest
from ros_helpers import traffic

from mtpgo_core.errors import ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters


def parameters(model, **values):
    return dataclasses.replace(PredictorParameters(), model=str(model), **values)


def window():
    history = TrackHistory(HistoryConfig())
    history.update(traffic(0.0))
    return history.window()


def test_a_missing_model_is_an_error_unless_it_is_not_required():
    with pytest.raises(ModelFileError, match=r"/no/such/model\.pt does not exist"):
        ModelHost(parameters("/no/such/model.pt"))
    host = ModelHost(parameters("/no/such/model.pt", require_model=False))
    assert "/no/such/model.pt does not exist" in host.degraded
    assert (host.predict(window()).source == Source.CONSTANT_VELOCITY).all()
    assert host.describe()["model"] == "constant velocity"
    assert not host.uses_lanes
    host.warm_up()


def test_a_model_predicts_and_is_described(models):
    host = ModelHost(parameters(models["quick"]))
    assert host.degraded == ""
    assert (host.predict(window()).source == Source.MODEL).all()
    assert (host.fallback(window()).source == Source.CONSTANT_VELOCITY).all()
    about = host.describe()
    assert (about["model"], about["file"]) == ("tiny", str(models["quick"]))
    assert (about["horizon_s"], about["modes"]) == ("5", "3")
    # Zero and empty parameters stand for the values of the model's task.
    assert (about["graph"], about["max_neighbours"], about["radius_m"]) == ("cover", "31", "100")
    host.configure(parameters(models["quick"], graph="each", max_neighbours=5, radius=30.0), "")
    about = host.describe()
    assert (about["graph"], about["max_neighbours"], about["radius_m"]) == ("each", "5", "30")


def test_the_parameter_has_priority_over_the_topic_of_the_ego(models):
    host = ModelHost(parameters(models["quick"]))
    for parameter, topic, number in (("", "3", 3), ("4", "3", 4), (" ", " 5 ", 5)):
        host.configure(parameters(models["quick"], ego_id=parameter), topic)
        assert host._ego_key.tolist() == [number, 0, 0, 0]
    host.configure(parameters(models["quick"]), "")
    assert host._ego_key is None


def test_a_missing_ego_and_missing_lanes_are_limitations(models):
    host = ModelHost(parameters(models["lanes"], graph="ego"))
    assert host.uses_lanes
    ego, lanes = host.limitations()
    assert "no ego" in ego
    assert "lane_markings" in lanes
    host.configure(parameters(models["lanes"], graph="ego"), "1")
    host.lanes.take_markings(LaneMap([np.array([[0.0, 2.0], [9.0, 2.0]])]), "map")
    assert host.limitations() == []


def test_parameters_that_change_while_another_model_is_loaded_hold_for_it(models):
    host = ModelHost(parameters(models["quick"]))
    loaded = ModelHost(parameters(models["wrong"]))
    host.configure(parameters(models["quick"], calibration_memory=99.0, max_neighbours=5), "")
    host.replace_by(loaded)
    assert host.calibrator.live.options.memory_s == 99.0
    assert host.predictor.options.max_neighbours == 5
