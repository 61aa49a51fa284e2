# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What training sees: the node's own features, the true future, and nothing else."""

import dataclasses

import numpy as np
import pytest
import torch
from rosbags.typesys import Stores, get_typestore
from torch_geometric.data import Batch
from torch_geometric.loader import DataLoader
from traffic import braking_cars, turning_cars

from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.scene.trails.trail_context import TrailContext
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.prepared_recording import RECORDED, RESTARTED, TRACKED, prepare
from mtpgo_training.scenes.scene_dataset import (
    SceneDataset,
    dense,
    hide_classes,
    to_scene,
    validation_scenes,
)
from mtpgo_training.scenes.windows import frames_every
from mtpgo_training.training.training_config import DataConfig

HISTORY = HistoryConfig()
SCENE = SceneConfig(max_neighbours=4, radius_m=50.0)
PLAIN = DataConfig(restart_probability=0.0)
H = 10


def sources(data=PLAIN, training=True, scene=SCENE, **changes):
    recording = braking_cars(**changes)
    return [prepare(recording, HISTORY, scene, data, training=training)]


def dataset(data=PLAIN, seed=1, scene=SCENE):
    return SceneDataset(sources(data, scene=scene), HISTORY, scene, data, H, seed)


@pytest.fixture(scope="module")
def online():
    """Windows from the recording as real message bytes, by their stamps."""
    store = get_typestore(Stores.ROS2_JAZZY)
    adapter, types = INPUTS["pointcloud2"], TypestoreTypes(store)
    history, windows = TrackHistory(HISTORY), {}
    for states in braking_cars().states():
        data = store.serialize_cdr(adapter.from_states(states, types), adapter.message_type)
        history.update(adapter.to_states(store.deserialize_cdr(data, adapter.message_type)))
        windows[states.stamp_ns] = history.window()
    return windows


def test_training_features_equal_online_features_through_real_messages(online):
    data = dataset()
    compared = 0
    for index in range(0, len(data), 7):
        item, sample = data.items[index], data[index]
        tracked = data.sources[0].windows[item.window]
        window = online[tracked.window.stamp_ns]
        (centre,) = np.flatnonzero((window.key == tracked.window.key[item.centre]).all(axis=1))
        batch = build_scenes(window, SCENE, centres=np.array([centre]))
        np.testing.assert_array_equal(sample.valid.numpy(), batch.valid[0])
        np.testing.assert_allclose(sample.x.numpy(), batch.features[0], atol=1e-5, rtol=1e-5)
        np.testing.assert_array_equal(sample.static.numpy(), batch.static[0])
        compared += int(batch.valid.sum())
    assert compared > 500


TRAILS = dataclasses.replace(SCENE, trails=True)


def trails_dataset(**data):
    config = DataConfig(stride_s=1.0, **data)
    source = prepare(turning_cars(), HISTORY, TRAILS, config, training=True)
    return SceneDataset([source], HISTORY, TRAILS, config, H, 1)


def known_share(data):
    """Share of the agents of all samples that have a way on."""
    known = [data[i].trails[:, 0, 0, 2] > 0.0 for i in range(len(data))]
    return float(torch.cat(known).float().mean())


def test_trails_are_those_of_the_node_and_end_up_in_the_batch():
    data = trails_dataset(trails_none_probability=0.0, trails_partial_probability=0.0)
    cars = turning_cars()
    frames = frames_every(cars, HISTORY.dt_s).tolist()
    asked = {tracked.window.stamp_ns for tracked in data.sources[0].windows}
    memory, stamps = TrailMemory(), {}
    for window in replay(cars, HISTORY, map(cars.stamp_ns, frames)):
        memory.add(window, HISTORY.dt_s)
        if window.stamp_ns not in asked:
            continue
        context = TrailContext(memory, H, HISTORY.dt_s)
        centres = np.flatnonzero(window.valid[:, -1])
        batch = build_scenes(window, TRAILS, centres=centres, trails=context)
        stamps[window.stamp_ns] = dict(zip(window.key[centres, 0], batch.trails, strict=True))
    compared = 0
    for index in range(0, len(data), 3):
        item, sample = data.items[index], data[index]
        tracked = data.sources[0].views[item.view].windows[item.window]
        track = tracked.track[item.centre]
        expected = stamps[tracked.window.stamp_ns][data.sources[0].recording.track_id[track]]
        if item.view == RECORDED:  # the others have other velocities
            given = sample.trails.numpy()
            np.testing.assert_allclose(given, expected[: len(given)], atol=1e-5)
            compared += int((given[..., 2] > 0.0).sum())
    assert compared > 500
    fields = dense(Batch.from_data_list([data[0], data[1]]))
    assert fields["trails"].shape[2:] == (3, H, 3)
    assert "trails" not in dense(Batch.from_data_list([dataset()[0]]))


def test_training_draws_memories_of_all_ages_and_validation_uses_the_whole_past():
    none = trails_dataset(trails_none_probability=1.0, trails_partial_probability=0.0)
    partial = trails_dataset(trails_none_probability=0.0, trails_partial_probability=1.0)
    whole = trails_dataset(trails_none_probability=0.0, trails_partial_probability=0.0)
    assert known_share(none) == 0.0
    assert 0.1 < known_share(partial) < 0.9 * known_share(whole)
    usual = trails_dataset()
    ages = np.array([item.trails_age for item in usual.items])
    assert 0.1 < (ages == 0.0).mean() < 0.3
    assert 0.3 < (ages == 1.0).mean() < 0.6
    scenes = validation_scenes(usual.sources, HISTORY, TRAILS, H)
    known = torch.cat([scene.trails[:, 0, 0, 2] > 0.0 for scene in scenes])
    assert float(known.float().mean()) > 0.7


def test_an_agent_whose_past_was_cut_does_not_find_its_own_trail():
    first = turning_cars(tracks=1)
    config = DataConfig(restart_probability=1.0, trails_none_probability=0.0)
    source = prepare(first, HISTORY, TRAILS, config, training=True)
    data = SceneDataset([source], HISTORY, TRAILS, config, H, 1)
    assert len(source.trails) > 20
    assert all(item.view == RESTARTED for item in data.items)
    assert known_share(data) == 0.0


def test_the_size_of_a_graph_is_known_before_it_is_cut():
    found = set()
    for scene in (SCENE, dataclasses.replace(SCENE, radius_m=9.0)):
        data = dataset(DataConfig(restart_probability=0.3), scene=scene)
        sizes = [item.agents for item in data.items[::5]]
        assert sizes == [data[i].num_nodes for i in range(0, len(data), 5)]
        found.update(sizes)
    assert found >= {1, 2, 5}


def test_targets_are_the_recorded_future_in_the_scene_frame():
    recording = braking_cars()
    data = dataset()
    item, sample = data.items[40], data[40]
    tracked = data.sources[0].windows[item.window]
    centre_row = sample.centre.nonzero().item()
    track = tracked.track[item.centre]
    origin = tracked.window.position[item.centre, -1]
    yaw = tracked.window.yaw[item.centre, -1]
    frame = round((tracked.window.stamp_ns - recording.start_time_ns) * 1e-9 * 10)
    for k in range(H):
        rows = (recording.frame == frame + 2 * (k + 1)) & (recording.track == track)
        if not rows.any():
            assert sample.weight[centre_row, k] == 0.0
            continue
        moved = recording.position[rows][0] - origin
        expected = [
            np.cos(yaw) * moved[0] + np.sin(yaw) * moved[1],
            -np.sin(yaw) * moved[0] + np.cos(yaw) * moved[1],
        ]
        np.testing.assert_allclose(sample.target[centre_row, k, :2], expected, atol=1e-4)
    assert sample.weight[centre_row].sum() > 0


def test_target_velocities_are_the_derivative_of_target_positions():
    sample = dataset()[30]
    known = (sample.weight > 0).all(dim=1)
    moved = (sample.target[known, 2:, :2] - sample.target[known, :-2, :2]) / 0.4
    torch.testing.assert_close(sample.target[known, 1:-1, 2:], moved, atol=0.05, rtol=0.01)


def test_unobserved_futures_have_no_weight_and_no_value():
    data = dataset()
    last = max(range(len(data)), key=lambda i: data.items[i].window)
    sample = data[last]
    assert sample.weight.sum() == 0.0
    assert (sample.target == 0.0).all()


def test_every_present_agent_is_in_a_graph_of_its_window():
    data = dataset()
    by_window = {}
    for index, item in enumerate(data.items):
        by_window.setdefault(item.window, []).append(index)
    tracked = data.sources[0].windows
    for window, indices in list(by_window.items())[::6]:
        centres = [data.items[i].centre for i in indices]
        batch = build_scenes(tracked[window].window, SCENE, centres=np.array(centres))
        present = np.flatnonzero(tracked[window].window.valid[:, -1])
        assert set(present) == set(batch.agent[batch.agent >= 0].tolist())


def test_epochs_differ_and_are_reproducible():
    data = dataset()
    first = list(data.items)
    data.set_epoch(1)
    assert data.items != first
    data.set_epoch(0)
    assert data.items == first


def test_a_centre_has_a_future_and_rarely_stands():
    data = dataclasses.replace(PLAIN, min_future_s=1.0)
    drawn = dataset(data)
    weights = [drawn[i].weight[0].sum() for i in range(len(drawn))]
    assert min(weights) >= 5
    assert len(drawn) < len(dataset())


def test_validation_counts_every_agent_once_an_instant():
    data = dataclasses.replace(PLAIN, validation_stride_s=1.0)
    prepared = sources(data, training=False)
    scenes = validation_scenes(prepared, HISTORY, SCENE, H)
    present = sum(int(w.window.valid[:, -1].sum()) for w in prepared[0].windows)
    assert sum(int(s.primary.sum()) for s in scenes) == present
    assert all(int(s.centre.sum()) == 1 for s in scenes)


def test_validation_baselines_are_in_the_scene_frame():
    data = dataclasses.replace(PLAIN, validation_stride_s=1.0)
    scene = validation_scenes(sources(data, training=False), HISTORY, SCENE, H)[20]
    now, velocity = scene.x[:, -1, :2], scene.x[:, -1, 2:4]
    there = scene.valid[:, -1]
    expected = now + velocity * (H * 0.2)
    torch.testing.assert_close(
        scene.baselines[there, 0, -1], expected[there], atol=1e-3, rtol=1e-4
    )


def test_dense_lays_graphs_of_different_sizes_out_without_mixing_them():
    data = dataset(scene=SceneConfig(max_neighbours=11, radius_m=25.0))
    samples = [data[i] for i in (0, 30, 60, 90)]
    assert len({s.num_nodes for s in samples}) > 1
    batch = next(iter(DataLoader(samples, batch_size=4)))
    fields = dense(batch)
    for b, sample in enumerate(samples):
        n = sample.num_nodes
        torch.testing.assert_close(fields["x"][b, :n], sample.x)
        torch.testing.assert_close(fields["target"][b, :n], sample.target)
        assert not fields["valid"][b, n:].any()
        assert fields["weight"][b, n:].sum() == 0.0


def test_scenes_of_a_tracker_have_its_observations_and_the_recordings_future():
    data = dataclasses.replace(PLAIN, tracker_share=0.5, tracker_variants=2)
    drawn = dataset(data)
    views = [item.view for item in drawn.items]
    assert set(views) == {RECORDED, TRACKED, TRACKED + 1}
    windows = {item.window: item.view for item in drawn.items}
    assert 0.3 < np.mean([view >= TRACKED for view in windows.values()]) < 0.7
    source, compared = drawn.sources[0], 0
    for i in range(0, len(drawn), 5):
        item, sample = drawn.items[i], drawn[i]
        tracked = source.views[item.view].windows[item.window]
        batch = build_scenes(tracked.window, SCENE, centres=np.array([item.centre]))
        np.testing.assert_array_equal(sample.x.numpy(), batch.features[0])
        assert sample.num_nodes == item.agents
        track = tracked.track[batch.agent[0]]
        future = source.future.at(track, tracked.window.stamp_ns, H, HISTORY.dt_s)
        local = to_scene(future.position - batch.origin[0], batch.rotation[0])
        known = sample.weight.numpy() > 0
        np.testing.assert_allclose(sample.target.numpy()[known, :2], local[known], atol=1e-4)
        compared += int(known.sum()) * (item.view >= TRACKED)
    assert compared > 100


def test_classes_are_hidden_in_a_share_of_the_scenes_and_sizes_are_kept():
    data = dataclasses.replace(PLAIN, unknown_class_share=0.5)
    drawn = dataset(data)
    hidden = [drawn[i].static.sum(dim=1) == 0 for i in range(0, len(drawn), 3)]
    nobody = np.mean([bool((~rows).all()) for rows in hidden])
    everybody = np.mean([bool(rows.all()) for rows in hidden])
    assert 0.3 < nobody < 0.7
    assert 0.15 < everybody < 0.5
    assert nobody + everybody < 1.0
    static = np.ones((6, 5), dtype=np.float32)
    out = [hide_classes(static, ("car", "unknown"), seed) for seed in range(20)]
    assert {tuple(row) for o in out for row in o.tolist()} == {(1, 1, 1, 1, 1), (0, 1, 1, 1, 1)}
    assert static.all()
    np.testing.assert_array_equal(hide_classes(static, ("car", "unknown"), 3), out[3])


def test_sizes_are_scaled_with_the_scene():
    data = dataclasses.replace(PLAIN, scale_std=0.2, mirror_probability=0.5)
    scene = dataclasses.replace(SCENE, sizes=True)
    scaled, plain = dataset(data, scene=scene), dataset(PLAIN, scene=scene)
    width = scene.static_features.index("width")
    (known,) = {float(plain[i].static[:, width].max()) for i in range(len(plain))}
    assert known > 0.0
    factors = [item.augmentation.scale for item in scaled.items]
    assert np.std(factors) > 0.1
    for i, factor in enumerate(factors):
        expected = torch.full_like(scaled[i].static[:, width], known * factor)
        torch.testing.assert_close(scaled[i].static[:, width], expected)


def test_validation_is_over_the_recorded_and_the_tracked_observations():
    data = dataclasses.replace(PLAIN, validation_stride_s=1.0)
    recorded = validation_scenes(sources(data, training=False), HISTORY, SCENE, H)
    both = dataclasses.replace(data, validation_tracker=True)
    prepared = sources(both, training=False)
    scenes = validation_scenes(prepared, HISTORY, SCENE, H)
    for one, other in zip(recorded, scenes, strict=False):
        torch.testing.assert_close(one.x, other.x)
    present = int(prepared[0].tracked[0].windows.instants.present.sum())
    more = scenes[len(recorded) :]
    assert present > 0
    assert sum(int(s.primary.sum()) for s in more) == present


def test_to_scene_turns_vectors_backwards():
    np.testing.assert_allclose(to_scene(np.array([0.0, 2.0]), np.pi / 2), [2.0, 0.0], atol=1e-12)
