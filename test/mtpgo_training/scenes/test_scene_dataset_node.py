# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node's model gets the features that training and validation cut, with every context."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.inputs.lane_markers import lanes_from_markers, lanes_to_markers
from msg_adapters.types import TypestoreTypes
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import SceneDataset, validation_scenes

HISTORY = HistoryConfig()
DATA = DataConfig(restart_probability=0.0, stride_s=0.6, validation_stride_s=0.6)
LANES = tuple(np.array([[-1e4, y], [1e4, y]]) for y in (-2.0, 2.0, 6.0))
CONTEXTS = ("none", "polar", "lanes", "leaders", "traffic", "road", "lane_ways")
H = 10


def two_lanes():
    """Cars in two lanes along x, some of which leave for good or for a second."""
    plain = braking_cars(tracks=14, seconds=6.0)
    time_s = plain.frame / plain.frame_rate
    x = 9.0 * plain.track + 8.0 * time_s + np.sin(time_s + plain.track)
    recording = dataclasses.replace(
        plain,
        position=np.stack([x, 4.0 * (plain.track % 2)], axis=1),
        velocity=np.stack([8.0 + np.cos(time_s + plain.track), 0.0 * x], axis=1),
        yaw=0.0 * x,
        lanes=LANES,
    )
    gone = (plain.track % 5 == 1) & (time_s > 3.0)
    hidden = (plain.track % 5 == 3) & (time_s > 2.0) & (time_s < 3.0)
    return recording.select_rows(~(gone | hidden))


class Recorder:
    """A model that keeps the scenes that the node gives it."""

    def __init__(self, scene):
        self.task = TaskDescription(scene=scene, history=HISTORY, horizon_steps=H)
        self.batches = []

    def predict_served(self, window, batch, initial_covariance=False, smoother=None):
        self.batches.append((window, batch))
        served, modes = np.unique(batch.agent[batch.primary]), self.task.modes
        own = window.select(served)
        return served, predict_constant_velocity(
            own, horizon_steps=H, dt_s=HISTORY.dt_s, modes=modes
        )


def node_scenes(recording, scene, stamps_ns, policy=None, lanes=None):
    """The windows and scenes that the node's model gets at the given times."""
    model = Recorder(scene)
    road = LaneMap(recording.lanes if lanes is None else lanes)
    predictor = ScenePredictor(model, options=PredictorOptions(policy=policy), lanes=road)
    for window in replay(recording, HISTORY, stamps_ns):
        predictor.predict(window)
    return model.batches


def scene_of(context):
    ways = context == "lane_ways"
    return SceneConfig(
        context="none" if ways else context,
        trails=ways,
        lane_ways=ways,
        max_neighbours=5,
        radius_m=40.0,
    )


def assert_same(sample, batch, b):
    there = batch.agent[b] >= 0
    np.testing.assert_array_equal(sample.valid.numpy(), batch.valid[b][there])
    np.testing.assert_array_equal(sample.x.numpy(), batch.features[b][there])
    np.testing.assert_array_equal(sample.static.numpy(), batch.static[b][there])
    if batch.trails is not None:  # the trails of training are exact to a hundredth of a millimetre
        np.testing.assert_allclose(sample.trails.numpy(), batch.trails[b][there], atol=1e-4)


@pytest.mark.parametrize("context", CONTEXTS)
def test_the_node_gets_the_features_of_training(context):
    recording, scene = two_lanes(), scene_of(context)
    source = prepare(recording, HISTORY, scene, DATA, training=True)
    data = SceneDataset([source], HISTORY, scene, DATA, H, 0)
    batches = node_scenes(recording, scene, source.windows.instants.stamp_ns, "each")
    departed = 0
    for i, item in enumerate(data.items):
        cut = source.windows[item.window].window
        departed += int((~cut.valid[:, -1]).sum())
        window, batch = batches[item.window]
        (b,) = np.flatnonzero((window.key == cut.key[item.centre]).all(axis=1))
        assert_same(data[i], batch, b)
    assert departed > 10  # the windows hold agents that the node leaves out


@pytest.mark.parametrize("context", CONTEXTS)
def test_the_node_gets_the_features_of_validation(context):
    recording, scene = two_lanes(), scene_of(context)
    source = prepare(recording, HISTORY, scene, DATA, training=False)
    scenes = iter(validation_scenes([source], HISTORY, scene, H))
    for _, batch in node_scenes(recording, scene, source.windows.instants.stamp_ns):
        for b in range(len(batch.agent)):
            sample = next(scenes)
            assert_same(sample, batch, b)
            there = batch.agent[b] >= 0
            np.testing.assert_array_equal(sample.primary.numpy(), batch.primary[b][there])
    assert next(scenes, None) is None


def lane_sources(recording, folder):
    """The recording with the lanes of its file, and the same lanes as a node gets them."""
    write_ind(recording, folder)
    (read,) = load_recordings(folder, "ind")
    path = folder / f"{recording.name}_lanes.geojson"
    message = lanes_to_markers(
        read.lanes, TypestoreTypes(bag_typestore()), stamp_ns=0, frame_id="map"
    )
    return read, {
        "lane file": read_lane_file(path).lines,
        "markers": lanes_from_markers(message).polylines,
    }


@pytest.mark.parametrize("context", ["road", "lane_ways"])
def test_lanes_of_a_recording_give_what_a_lane_file_and_markers_give_the_node(context, tmp_path):
    plain = two_lanes()
    plain = plain.select_rows(plain.frame < 25)
    x = np.linspace(-20.0, 300.0, 200)
    bent = tuple(np.stack([x, y + 3.0 * np.sin(0.02 * x)], axis=1) for y in (-2.0, 2.0, 6.0))
    recording, sources = lane_sources(dataclasses.replace(plain, lanes=bent), tmp_path)
    scene = scene_of(context)
    # Trails are those of the node if it gets an observation at each step of the grid.
    data = dataclasses.replace(DATA, validation_stride_s=HISTORY.dt_s)
    prepared = prepare(recording, HISTORY, scene, data, training=False)
    used = 0
    for lanes in sources.values():
        scenes = iter(validation_scenes([prepared], HISTORY, scene, H))
        stamps_ns = prepared.windows.instants.stamp_ns
        for _, batch in node_scenes(recording, scene, stamps_ns, lanes=lanes):
            for b in range(len(batch.agent)):
                assert_same(next(scenes), batch, b)
            last = batch.features[..., -3:] if batch.trails is None else batch.trails
            used += int(np.count_nonzero(last))
    assert used > 1000
