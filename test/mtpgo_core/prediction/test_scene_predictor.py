# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From observations to predictions: every agent, every cycle, whatever the model does."""

import dataclasses

import numpy as np
import pytest
from core_helpers import HORIZON, MODES, states_of, write_model, write_trail_model

from mtpgo_core.errors import ConfigurationError, ModelFileError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import key_to_int, keys_from_integers
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.schema import AgentClass, Source
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription


@pytest.fixture(scope="module")
def runner(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "m.pt"
    write_model(path)
    return ModelRunner.load(path)


class Stream:
    """A history and the predictor of its windows, as the node has them."""

    def __init__(self, *arguments, **options):
        self.predictor = ScenePredictor(*arguments, **options)
        self.history = TrackHistory(self.predictor.task.history)

    def predict(self, **options):
        return self.predictor.predict(self.history.window(), **options)


def drive(stream, count=12, cycles=10, spacing_m=15.0, speed=8.0, start=0):
    """Agents in a row that drive along x; returns the last report."""
    speeds = np.broadcast_to(speed, count)
    for k in range(start, start + cycles):
        position = np.stack(
            [spacing_m * np.arange(count) + 0.1 * k * speeds, np.zeros(count)], axis=1
        )
        velocity = np.stack([speeds, np.zeros(count)], axis=1)
        report = stream.history.update(
            states_of(0.1 * k, range(count), position, velocity=velocity)
        )
    return report


def ids_of(prediction):
    return [key_to_int(k) for k in prediction.key]


def check_complete(prediction, ids):
    """All agents, all numbers, weights that sum to one, positive definite covariances."""
    assert ids_of(prediction) == list(ids)
    for field in ("initial", "initial_yaw", "weight", "mean", "yaw", "covariance"):
        assert np.isfinite(getattr(prediction, field)).all(), field
    np.testing.assert_allclose(prediction.weight.sum(axis=1), 1.0)
    assert (np.diff(prediction.weight, axis=1) <= 0.0).all()
    assert (np.linalg.eigvalsh(prediction.covariance) > 0.0).all()


def test_without_a_model_everybody_goes_straight_on():
    stream = Stream(None)
    assert len(stream.predict()) == 0
    drive(stream)
    given = stream.predict()
    check_complete(given, range(12))
    assert given.mean.shape == (12, 1, 25, 4)
    assert (given.source == Source.CONSTANT_VELOCITY).all()
    np.testing.assert_allclose(given.mean[:, 0, -1, 0], given.initial[:, 0] + 5.0 * 8.0)
    assert stream.predictor.last_report.by_model == 0


def test_without_a_model_the_given_task_counts():
    task = TaskDescription(horizon_steps=7, history=HistoryConfig(dt_s=0.5, steps=3))
    stream = Stream(None, task=task)
    drive(stream)
    given = stream.predict()
    np.testing.assert_allclose(given.time_s, 0.5 * np.arange(1, 8))


@pytest.mark.parametrize("policy", [None, "ego", "cover", "each", "scene"])
def test_the_model_serves_everybody(runner, policy):
    stream = Stream(runner, options=PredictorOptions(policy=policy))
    drive(stream)
    given = stream.predict(ego_key=keys_from_integers([3])[0])
    check_complete(given, range(12))
    assert given.mean.shape == (12, MODES, HORIZON, 4)
    assert (given.source == Source.MODEL).all()
    # Mode 0 of the file's model is constant velocity; it has the least weight.
    np.testing.assert_allclose(
        given.mean[:, -1, -1, 0], given.initial[:, 0] + 8.0 * 0.2 * HORIZON, atol=1e-4
    )
    report = stream.predictor.last_report
    assert (report.agents, report.by_model, report.unusable, report.over_limit) == (12, 12, 0, 0)
    assert report.graphs == {"each": 12, "scene": 1}.get(policy, report.graphs)


def test_an_agent_the_model_fails_on_goes_straight_on(runner):
    stream = Stream(runner)
    speed = np.where(np.arange(12) == 4, 65.0, 8.0)  # the model of the test gives NaN above 60
    drive(stream, speed=speed)
    given = stream.predict()
    check_complete(given, range(12))
    assert np.flatnonzero(given.source == Source.CONSTANT_VELOCITY).tolist() == [4]
    assert given.weight[4].tolist() == [1.0, 0.0, 0.0]
    np.testing.assert_allclose(given.mean[4, 0, -1, 2:], [65.0, 0.0])
    assert stream.predictor.last_report.unusable == 1


def test_beyond_max_agents_the_nearest_keep_the_model(runner):
    stream = Stream(runner, options=PredictorOptions(max_agents=5))
    drive(stream)
    given = stream.predict()
    check_complete(given, range(12))
    assert len(given) == 12
    by_model = np.flatnonzero(given.source == Source.MODEL)
    assert by_model.tolist() in ([3, 4, 5, 6, 7], [4, 5, 6, 7, 8])  # around the middle
    assert stream.predictor.last_report.over_limit == 7
    given = stream.predict(ego_key=keys_from_integers([11])[0])
    assert np.flatnonzero(given.source == Source.MODEL).tolist() == [7, 8, 9, 10, 11]
    x = 15.0 * np.arange(12) + 0.9 * 8.0
    np.testing.assert_allclose(given.initial[:, 0], x)
    straight = np.where(given.source == Source.MODEL, -1, 0)  # the last mode, or the only one
    np.testing.assert_allclose(
        given.mean[np.arange(12), straight, -1, 0], x + 8.0 * 0.2 * HORIZON, atol=1e-4
    )
    stream.predictor.options = PredictorOptions(max_agents=0)
    given = stream.predict()
    check_complete(given, range(12))
    assert (given.source == Source.CONSTANT_VELOCITY).all()


class Watched(ModelRunner):
    """A runner that keeps its last window and scenes."""

    def predict_served(self, window, batch, initial_covariance=False, smoother=None):
        self.window, self.batch = window, batch
        return super().predict_served(window, batch, initial_covariance, smoother)


def watched_stream(tmp_path, context, **options):
    """A stream whose model has the given context."""
    write_model(tmp_path / f"{context}.pt", scene=SceneConfig(context=context))
    runner = Watched.load(tmp_path / f"{context}.pt")
    return Stream(runner, options=PredictorOptions(**options)), runner


@pytest.mark.parametrize("context", ["leaders", "traffic"])
def test_an_agent_beyond_max_agents_is_still_the_leader(tmp_path, context):
    stream, runner = watched_stream(tmp_path, context, max_agents=1)
    drive(stream, count=3)
    stream.predict(ego_key=keys_from_integers([1])[0])
    assert stream.predictor.last_report.over_limit == 2
    assert runner.batch.agent.tolist() == [[1, 0, 2]]
    assert runner.batch.primary.tolist() == [[True, False, False]]
    gap = runner.task.scene.features.index("lead1_gap")
    length = 0.0 if context == "leaders" else 4.5
    np.testing.assert_allclose(runner.batch.features[0, 0, -1, gap], 15.0 - length, atol=1e-4)


@pytest.mark.parametrize("policy", ["ego", "each"])
@pytest.mark.parametrize("context", ["none", "traffic"])
def test_the_limit_does_not_change_the_predictions_of_the_served(tmp_path, policy, context):
    ego = keys_from_integers([6])[0]
    found = []
    for most in (100, 5):
        stream, runner = watched_stream(tmp_path, context, max_agents=most, policy=policy)
        drive(stream, spacing_m=10.0)
        given = stream.predict(ego_key=ego)
        batch, graphs = runner.batch, {}
        for row, primary, features in zip(batch.agent, batch.primary, batch.features, strict=True):
            graphs |= {
                agent: (row[row >= 0].tolist(), features[row >= 0])
                for agent in row[primary].tolist()
            }
        found.append((given, graphs))
    (given, graphs), (limited, few) = found
    same = [agent for agent in sorted(few) if few[agent][0] == graphs[agent][0]]
    assert sorted(few) == [4, 5, 6, 7, 8]
    assert same == sorted(few)
    for agent in same:
        np.testing.assert_array_equal(few[agent][1], graphs[agent][1])
        np.testing.assert_array_equal(limited.mean[agent], given.mean[agent])
        np.testing.assert_array_equal(limited.weight[agent], given.weight[agent])


def test_agents_at_the_limit_do_not_take_turns(runner):
    draw = np.random.default_rng(0)
    stream = Stream(runner, options=PredictorOptions(max_agents=10))
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    by_model = set()
    for k in range(20):
        ring = 30.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        stream.history.update(
            states_of(0.1 * k, range(20), ring + draw.normal(size=(20, 2)) * 0.5)
        )
        given = stream.predict()
        by_model |= set(np.flatnonzero(given.source == Source.MODEL).tolist())
    assert len(by_model) == 10


def test_options_change_while_running(runner):
    stream = Stream(runner)
    drive(stream)
    graphs = []
    for options in (
        PredictorOptions(policy="each"),
        PredictorOptions(policy="each", max_neighbours=3),
        PredictorOptions(radius_m=1.0),
    ):
        stream.predictor.options = options
        stream.predict()
        graphs.append(
            (stream.predictor.last_report.graphs, stream.predictor.last_report.largest_graph)
        )
    assert graphs == [(12, 12), (12, 4), (12, 1)]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": "star"}, "policy is 'star', expected one of 'ego', 'cover', 'each', 'scene'"),
        ({"radius_m": 0.0}, "radius_m is 0.0, expected more than 0"),
        ({"radius_m": float("nan")}, "radius_m is nan"),
        ({"max_agents": -1}, "max_agents is -1"),
        ({"max_neighbours": -1}, "max_neighbours is -1, expected at least 0"),
    ],
)
def test_impossible_options_are_errors(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        PredictorOptions(**changes)


def test_the_trackers_covariance_is_used_when_asked_for(runner):
    stream = Stream(runner, options=PredictorOptions(use_tracker_covariance=True))
    covariance = 9.0 * np.eye(4)[None]
    stream.history.update(states_of(0.0, [1], [[0, 0]], velocity=[[5, 0]], covariance=covariance))
    wide = stream.predict().covariance[0, 0, 0]
    stream.predictor.options = PredictorOptions()
    narrow = stream.predict().covariance[0, 0, 0]
    np.testing.assert_allclose(wide - narrow, 8.0 * np.eye(2), atol=1e-5)


def test_a_late_window_is_predicted_as_it_was(runner):
    stream = Stream(runner)
    drive(stream, cycles=10)
    window = stream.history.window()
    before = stream.predictor.predict(window)
    drive(stream, cycles=5, start=10)
    again = stream.predictor.predict(window)
    np.testing.assert_array_equal(before.mean, again.mean)
    assert stream.predict().stamp_ns == 1_400_000_000


def test_the_fallback_has_the_shape_of_the_prediction(runner):
    stream = Stream(runner)
    drive(stream)
    given, fallback = stream.predict(), stream.predictor.fallback(stream.history.window())
    check_complete(fallback, range(12))
    assert (fallback.source == Source.CONSTANT_VELOCITY).all()
    for field in dataclasses.fields(given):
        first, second = getattr(given, field.name), getattr(fallback, field.name)
        if isinstance(first, np.ndarray):
            assert first.shape == second.shape, field.name
            assert first.dtype == second.dtype, field.name


def test_a_reset_forgets_everything(runner):
    stream = Stream(runner)
    drive(stream)
    stream.history.clear()
    stream.predictor.reset()
    assert stream.history.newest_stamp_ns is None
    assert len(stream.predict()) == 0
    drive(stream, count=3)
    check_complete(stream.predict(), range(3))


def test_a_stream_after_a_pause_does_not_depend_on_the_one_before(runner):
    options = PredictorOptions(radius_m=30.0)
    fresh, used = Stream(runner, options=options), Stream(runner, options=options)
    # The same numbers in another order along the road, so other agents become centres.
    drive(used, spacing_m=-20.0, speed=5.0)
    used.predict()
    for stream in (fresh, used):
        drive(stream, start=600)
        stream.predict()
    assert fresh.predictor._graphs.centre.tolist() == used.predictor._graphs.centre.tolist()
    assert fresh.predictor._graphs.owner.tolist() == used.predictor._graphs.owner.tolist()


def test_agents_that_come_and_go_are_all_predicted(runner):
    draw = np.random.default_rng(1)
    stream = Stream(runner)
    for k in range(60):
        ids = np.sort(draw.choice(30, draw.integers(0, 25), replace=False))
        bad = draw.random(len(ids)) < 0.1
        position = np.stack([30.0 * ids, 0.3 * k + 0.0 * ids], axis=1)
        position[bad] = np.nan
        stream.history.update(states_of(0.1 * k, ids, position))
        given = stream.predict()
        assert set(ids[~bad].tolist()) <= set(ids_of(given))
        check_complete(given, sorted(ids_of(given)))


def test_a_lane_model_without_lanes_is_an_error_and_the_fallback_stays(tmp_path):
    write_model(tmp_path / "lanes.pt", scene=SceneConfig(context="lanes"))
    stream = Stream(ModelRunner.load(tmp_path / "lanes.pt"))
    drive(stream)
    with pytest.raises(ConfigurationError, match="lane"):
        stream.predict()
    check_complete(stream.predictor.fallback(stream.history.window()), range(12))


def test_one_agent_and_one_sample_are_enough(runner):
    stream = Stream(runner)
    stream.history.update(states_of(0.0, [1 << 100], [[5.0, 6.0]]))
    given = stream.predict()
    check_complete(given, [1 << 100])
    assert given.initial[0].tolist() == [5.0, 6.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def trail_runner(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "trails.pt"
    write_trail_model(path)
    return ModelRunner.load(path)


def follow(stream, count=1, cycles=30, start=0, frame="map", rarely=False):
    """Agents 16 m apart around a ring of 30 m, five cycles a second; the last prediction.

    With ``rarely`` the windows before the last one are only observed, every three seconds.
    """
    for k in range(start, start + cycles):
        angle = (1.6 * k + 16.0 * np.arange(count)) / 30.0
        states = states_of(
            0.2 * k,
            range(count),
            30.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1),
            frame=frame,
            velocity=8.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1),
            yaw=(angle + np.pi) % (2.0 * np.pi) - np.pi,
            agent_class=np.full(count, AgentClass.PEDESTRIAN, np.uint8),  # may turn back
        )
        stream.history.update(states)
        if not rarely or k == start + cycles - 1:
            given = stream.predict()
        elif k % 15 == 0:
            stream.predictor.observe(stream.history.window())
    return given


def bent(prediction):
    """[n] whether the model was told of a way that bends, on which mode 0 of this model goes."""
    return np.abs(prediction.mean[:, 0, -1, :2]).sum(axis=-1) > 0.1


def test_a_model_with_trails_gets_the_ways_of_those_ahead(trail_runner):
    stream = Stream(trail_runner)
    given = follow(stream, count=3)
    assert (given.source == Source.MODEL).all()
    assert bent(given).tolist() == [True, True, False]
    distance = 1.6 * HORIZON
    x, y = 30.0 * np.sin(distance / 30.0), 30.0 * (1.0 - np.cos(distance / 30.0))
    assert given.mean[0, 0, -1, :2] == pytest.approx([x - distance, y], abs=0.2)
    assert not bent(follow(Stream(trail_runner), count=1)).any()


def test_trails_are_seen_without_a_prediction(trail_runner):
    stream = Stream(trail_runner)
    assert bent(follow(stream, count=3, rarely=True)).tolist() == [True, True, False]


def test_agents_over_the_limit_leave_trails(trail_runner):
    stream = Stream(trail_runner, options=PredictorOptions(max_agents=0))
    follow(stream, count=3)
    stream.predictor.options = PredictorOptions()
    assert bent(follow(stream, count=3, start=30, cycles=1)).tolist() == [True, True, False]


def test_trails_can_be_hidden_from_the_model(trail_runner):
    stream = Stream(trail_runner, options=PredictorOptions(trails=False))
    assert not bent(follow(stream, count=3)).any()
    stream.predictor.options = PredictorOptions()
    assert bent(follow(stream, count=3, start=30, cycles=1)).tolist() == [True, True, False]


def test_trails_are_forgotten_with_the_history_and_in_another_frame(trail_runner):
    stream = Stream(trail_runner)
    follow(stream, count=3)
    stream.history.clear()
    stream.predictor.reset()
    assert not bent(follow(stream, count=3, start=30, cycles=1)).any()
    follow(stream, count=3, start=31, cycles=20)
    given = follow(stream, count=3, start=51, cycles=3, frame="odom")
    assert given.frame_id == "odom"
    assert not bent(given).any()
    follow(stream, count=3, start=54, cycles=20, frame="odom")
    assert not bent(follow(stream, count=3, start=0, cycles=3, frame="odom")).any()


def test_a_task_without_trails_keeps_none(runner):
    stream = Stream(runner)
    drive(stream)
    stream.predict()
    assert len(stream.predictor._trails) == 0


def test_a_model_file_that_does_not_take_its_trails_is_refused(tmp_path):
    write_model(tmp_path / "m.pt", scene=SceneConfig(trails=True))
    with pytest.raises(ModelFileError, match="does not run on the input"):
        ModelRunner.load(tmp_path / "m.pt")


def test_path_smoothing_combines_cycles_and_ends_with_a_reset(runner):
    plain = Stream(runner)
    smooth = Stream(runner, options=PredictorOptions(path_smoothing_s=0.4))
    for stream in (plain, smooth):
        drive(stream)
        stream.predict()
        drive(stream, start=10, cycles=2, speed=8.5)  # news: the model follows at once
    new, smoothed = plain.predict().mean, smooth.predict().mean
    assert 0.1 < np.abs(new - smoothed)[:, 0, -1, 0].max() < 5.0
    np.testing.assert_allclose(smoothed[:, 0, 0, 0], new[:, 0, 0, 0], atol=0.2)
    smooth.predictor.reset()
    np.testing.assert_array_equal(smooth.predict().mean, new)
