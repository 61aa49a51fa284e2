# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The runner with a real TorchScript model whose answers are known."""

import dataclasses
import math
import threading
import warnings

import numpy as np
import pytest
import torch
from core_helpers import HORIZON, MODES, states_of, write_model

from mtpgo_core.errors import ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import TASK_FILE, HistoryConfig, SceneConfig, TaskDescription

TIME_S = 0.2 * np.arange(1, HORIZON + 1)


def observed(count=20, seed=0, shift=0.0, **more):
    """Agents at constant velocity and their states at t: position, velocity, yaw."""
    draw = np.random.default_rng(seed)
    position = draw.uniform(-80, 80, (count, 2)) + shift
    velocity = draw.uniform(-12, 12, (count, 2))
    yaw = draw.uniform(-3, 3, count)
    history = TrackHistory(HistoryConfig())
    for k in range(6):
        history.update(
            states_of(
                0.2 * k,
                range(count),
                position + 0.2 * k * velocity,
                velocity=velocity,
                yaw=yaw,
                **more,
            )
        )
    return history.window(), position + velocity, velocity, yaw


def drift(angle):
    """[n, 2] unit vectors of the scenes' x axes."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("policy", ["each", "cover", "scene"])
def test_means_come_back_in_the_fixed_frame(tmp_path, order, policy):
    write_model(tmp_path / "m.pt", order)
    runner = ModelRunner.load(tmp_path / "m.pt")
    window, position, velocity, yaw = observed(shift=3e5)
    batch = build_scenes(window, SceneConfig(policy=policy, max_neighbours=6))
    given = runner.predict(window, batch)
    graph, slot = np.nonzero(batch.primary)
    rotation = np.empty(len(window))
    rotation[batch.agent[graph, slot]] = batch.rotation[graph]
    for rank in range(MODES):  # the heaviest mode, which the model numbers last, comes first
        mode = MODES - 1 - rank
        expected_v = velocity + mode * drift(rotation)
        expected = position[:, None] + expected_v[:, None] * TIME_S[:, None]
        np.testing.assert_allclose(given.mean[:, rank, :, :2], expected, atol=2e-5)
        np.testing.assert_allclose(
            given.mean[:, rank, :, 2:], np.repeat(expected_v[:, None], HORIZON, 1), atol=3e-4
        )
        moving = np.hypot(*expected_v.T) > 0.6
        course = np.where(moving, np.arctan2(expected_v[:, 1], expected_v[:, 0]), yaw)
        np.testing.assert_allclose(given.yaw[:, rank, 0], course, atol=1e-3)
    np.testing.assert_allclose(given.weight, np.tile([3 / 6, 2 / 6, 1 / 6], (20, 1)))
    np.testing.assert_allclose(given.weight.sum(axis=1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(given.initial, np.concatenate([position, velocity], axis=1))
    np.testing.assert_allclose(given.time_s, TIME_S)
    assert (given.source == Source.MODEL).all()
    assert given.mean.dtype == np.float64


def test_covariances_are_turned(tmp_path):
    write_model(tmp_path / "m.pt")
    runner = ModelRunner.load(tmp_path / "m.pt")
    window, _, _, yaw = observed()
    given = runner.predict(window, build_scenes(window, SceneConfig(policy="each")))
    sideways = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    growth = sideways[:, :, None] * sideways[:, None, :]
    for k in range(HORIZON):
        expected = np.eye(2) + (k + 1) * growth
        for mode in range(MODES):
            np.testing.assert_allclose(given.covariance[:, mode, k], expected, atol=1e-5)
    np.testing.assert_array_equal(given.covariance[..., 0, 1], given.covariance[..., 1, 0])


@pytest.mark.parametrize("order", [1, 2])
def test_the_trackers_covariance_reaches_the_model_in_the_scene_frame(tmp_path, order):
    write_model(tmp_path / "m.pt", order)
    runner = ModelRunner.load(tmp_path / "m.pt")
    factor = np.random.default_rng(1).normal(size=(20, 4, 4))
    tracked = factor @ factor.transpose(0, 2, 1) + 0.1 * np.eye(4)
    tracked[3] = np.nan
    tracked[4, 0, 0] = -5.0
    window, _, _, yaw = observed(covariance=tracked)
    batch = build_scenes(window, SceneConfig(policy="each"))
    given = runner.predict(window, batch, initial_covariance=True)
    plain = runner.predict(window, batch)
    sideways = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    growth = sideways[:, :, None] * sideways[:, None, :]
    expected = tracked[:, :2, :2].copy()
    expected[3:5] = np.eye(2)
    np.testing.assert_allclose(given.covariance[:, 0, 0], expected + growth, atol=1e-4)
    np.testing.assert_allclose(plain.covariance[:, 0, 0], np.eye(2) + growth, atol=1e-5)


def test_an_agent_with_unusable_numbers_is_nan_and_alone(tmp_path):
    write_model(tmp_path / "m.pt")
    runner = ModelRunner.load(tmp_path / "m.pt")
    history = TrackHistory(HistoryConfig())
    history.update(
        states_of(0.0, range(3), [[0, 0], [50, 0], [90, 0]], velocity=[[5, 0], [70, 0], [5, 0]])
    )
    window = history.window()
    given = runner.predict(window, build_scenes(window, SceneConfig(policy="scene")))
    for values in (given.weight, given.mean, given.yaw, given.covariance):
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()


def test_agents_without_a_prediction_are_nan(model_file):
    runner = ModelRunner.load(model_file)
    history = TrackHistory(HistoryConfig())
    history.update(states_of(0.0, [1, 2], [[0, 0], [5, 5]], velocity=np.ones((2, 2))))
    history.update(states_of(1.0, [2], [[6, 6]], velocity=np.ones((1, 2))))
    window = history.window()
    given = runner.predict(window, build_scenes(window, SceneConfig()))
    assert np.isfinite(given.weight).all(axis=1).tolist() == [False, True]
    no_agents = window.select(np.zeros(2, dtype=bool))
    empty = runner.predict(no_agents, build_scenes(no_agents, SceneConfig()))
    assert empty.mean.shape == (0, MODES, HORIZON, 4)


@pytest.mark.parametrize(("name", "limit"), [("_PAIRS_AT_ONCE", 300), ("_ROWS_AT_ONCE", 30)])
def test_many_graphs_are_served_in_pieces_with_the_same_result(
    model_file, monkeypatch, name, limit
):
    runner = ModelRunner.load(model_file)
    window, *_ = observed(40)
    batch = build_scenes(window, SceneConfig(policy="each", radius_m=70.0, max_neighbours=9))
    calls = []
    forward = ModelRunner._forward

    def counted(self, features, *rest):
        calls.append(features.shape[:2])
        return forward(self, features, *rest)

    monkeypatch.setattr(ModelRunner, "_forward", counted)
    monkeypatch.setattr("mtpgo_core.prediction.model_runner._ROWS_AT_ONCE", 1000)
    whole = runner.predict(window, batch)
    assert len(calls) == 1
    monkeypatch.setattr(f"mtpgo_core.prediction.model_runner.{name}", limit)
    pieces = runner.predict(window, batch)
    assert len(calls) == 1 + math.ceil(40 / 3)
    assert {b for b, _ in calls[1:]} == {2, 3}  # about equal
    assert all(b * n <= 30 for b, n in calls[1:])
    for field in dataclasses.fields(whole):
        np.testing.assert_array_equal(getattr(whole, field.name), getattr(pieces, field.name))


def test_loading_and_running_warns_of_nothing(model_file):
    window, *_ = observed(5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runner = ModelRunner.load(model_file)
        runner.predict(window, build_scenes(window, SceneConfig()))


def test_threads_are_set_and_another_thread_may_predict(model_file):
    runner = ModelRunner.load(model_file, num_threads=2)
    assert torch.get_num_threads() == 2
    ModelRunner.load(model_file, num_threads=None)
    assert torch.get_num_threads() == 2
    ModelRunner.load(model_file)
    assert torch.get_num_threads() == 1
    window, *_ = observed(5)
    batch = build_scenes(window, SceneConfig())
    results = []
    thread = threading.Thread(target=lambda: results.append(runner.predict(window, batch)))
    thread.start()
    thread.join()
    np.testing.assert_array_equal(results[0].mean, runner.predict(window, batch).mean)


class TwoOutputs(torch.nn.Module):
    def forward(self, features: torch.Tensor, valid: torch.Tensor) -> torch.Tensor:
        return features + valid.sum()


def save(path, module, task):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        scripted = torch.jit.script(module)
        torch.jit.save(scripted, str(path), _extra_files={TASK_FILE: task.to_json()})


def test_torchscript_of_another_kind_is_an_error(tmp_path):
    save(tmp_path / "other.pt", TwoOutputs(), TaskDescription())
    with pytest.raises(ModelFileError, match=r"other\.pt does not run on the input") as caught:
        ModelRunner.load(tmp_path / "other.pt")
    assert "\n" not in str(caught.value)


def test_a_task_that_tells_another_shape_is_an_error(tmp_path):
    write_model(tmp_path / "m.pt", task=TaskDescription(horizon_steps=HORIZON, modes=MODES + 1))
    with pytest.raises(ModelFileError, match="its task description says"):
        ModelRunner.load(tmp_path / "m.pt")
