# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From the output in scene frames to the published prediction, by hand-worked numbers."""

import dataclasses

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.prediction.output_assembly import (
    ModelOutput,
    assemble,
    delay_ns,
    from_horizon_start,
    replace_rows,
    select,
    time_grid,
    with_time_origin,
    without_agent,
)
from mtpgo_core.prediction.paths.path_smoothing import PathSmoother
from mtpgo_core.schema import SceneBatch, Source

DT_S = 0.5


def window(n=3):
    """Agents at (10 i, 0) m that drive at (0, 2) m/s with yaw 0.25 rad; one history step."""
    position = np.array([[[10.0 * i, 0.0]] for i in range(n)])
    velocity = np.tile([0.0, 2.0], (n, 1, 1))
    return window_of(position, velocity, np.full((n, 1), 0.25))


def batch(agent, primary, origin, rotation):
    """Scenes of which only the placement matters here."""
    agent = np.array(agent)
    return SceneBatch(
        features=np.zeros((*agent.shape, 1, 8), np.float32),
        valid=(agent >= 0)[..., None],
        static=np.zeros((*agent.shape, 0), np.float32),
        origin=np.array(origin, dtype=float),
        rotation=np.array(rotation, dtype=float),
        agent=agent,
        primary=np.array(primary),
    )


def output(mean, weight, covariance):
    """Output of p agents: mean [p, M, H, S], weights [p, M], one covariance [2, 2] for all."""
    mean = np.array(mean, dtype=np.float32)
    return ModelOutput(
        log_weight=np.log(np.array(weight, dtype=np.float32)),
        mean=mean,
        covariance=np.broadcast_to(
            np.array(covariance, dtype=np.float32), (*mean.shape[:3], 2, 2)
        ).copy(),
    )


def test_states_and_covariances_are_rotated_and_shifted():
    scenes = batch([[1]], [[True]], [[100.0, 200.0]], [np.pi / 2])
    given = output([[[[1.0, 2.0, 3.0, 4.0]]]], [[1.0]], [[4.0, 0.5], [0.5, 1.0]])
    prediction = assemble(window(), scenes, given, DT_S)
    # A quarter turn maps (x, y) to (-y, x).
    assert prediction.mean[1, 0, 0] == pytest.approx([98.0, 201.0, -4.0, 3.0])
    assert prediction.covariance[1, 0, 0] == pytest.approx(np.array([[1.0, -0.5], [-0.5, 4.0]]))
    assert prediction.yaw[1, 0, 0] == pytest.approx(np.arctan2(3.0, -4.0))
    assert prediction.initial[1].tolist() == [10.0, 0.0, 0.0, 2.0]
    assert prediction.initial_yaw[1] == 0.25
    assert prediction.time_s.tolist() == [DT_S]
    assert (prediction.source == Source.MODEL).all()
    # Agents that are primary nowhere have no prediction.
    assert np.isnan(prediction.mean[[0, 2]]).all()
    assert np.isnan(prediction.weight[[0, 2]]).all()


def test_each_agent_comes_from_its_primary_graph():
    scenes = batch(
        [[0, 1], [2, 1]], [[True, False], [True, True]], [[0, 0], [1000, 0]], [0.0, 0.0]
    )
    mean = [[[[1.0, 0, 0, 0]]], [[[2.0, 0, 0, 0]]], [[[3.0, 0, 0, 0]]]]  # row-major primaries
    prediction = assemble(window(), scenes, output(mean, [[1.0]] * 3, np.eye(2)), DT_S)
    assert prediction.mean[:, 0, 0, 0].tolist() == [1.0, 1003.0, 1002.0]


def test_modes_are_sorted_by_weight_with_all_that_belongs_to_them():
    mean = [[[[0.0, 0, 1, 0]], [[1.0, 0, 1, 0]], [[2.0, 0, 1, 0]]]]
    scenes = batch([[0]], [[True]], [[0.0, 0.0]], [0.0])
    # Weights need not be normalised.
    given = output(mean, [[0.2, 0.6, 0.4]], np.eye(2))
    given.covariance[0, :, 0, 0, 0] = [10.0, 11.0, 12.0]
    prediction = assemble(window(1), scenes, given, DT_S)
    assert prediction.weight[0] == pytest.approx([0.5, 1 / 3, 1 / 6])
    assert prediction.weight[0].sum() == pytest.approx(1.0, abs=1e-15)
    assert prediction.mean[0, :, 0, 0].tolist() == [1.0, 2.0, 0.0]
    assert prediction.covariance[0, :, 0, 0, 0].tolist() == [11.0, 12.0, 10.0]


def test_modes_are_moved_apart_with_their_velocities_and_yaws():
    mean = [[[[0.0, 0.0, 1.0, 0.0]], [[0.0, 0.1, 1.0, 0.4]], [[0.0, -0.1, 1.0, -0.4]]]]
    scenes = batch([[0]], [[True]], [[0.0, 0.0]], [0.0])
    # Spread 0.1 sqrt(0.25 + 0.25); the root of the trace is 0.2 sqrt(2), half of it twice as much.
    given = output(mean, [[0.5, 0.25, 0.25]], 0.04 * np.eye(2))
    prediction = assemble(window(1), scenes, given, DT_S, least_mode_spread=0.5)
    assert prediction.mean[0, :, 0].tolist() == [
        [0.0, 0.0, 1.0, 0.0],
        pytest.approx([0.0, 0.2, 1.0, 1.0]),  # 2 x 0.4 m/s, and 0.1 m more in 0.5 s
        pytest.approx([0.0, -0.2, 1.0, -1.0]),
    ]
    assert prediction.yaw[0, :, 0] == pytest.approx([0.0, np.pi / 4, -np.pi / 4])


def test_modes_are_smoothed_before_they_are_moved_apart():
    scenes = batch([[0]], [[True]], [[0.0, 0.0]], [0.0])
    mean = np.zeros((1, 2, 2, 4))
    mean[0, 1, :, 1] = [0.5, 1.0]
    mean[..., 2] = 2.0

    def published(smoother, stamp_s, weight, least):
        at = dataclasses.replace(window(1), stamp_ns=round(stamp_s * 1e9))
        given = output(mean, [weight], 100.0 * np.eye(2))
        return assemble(
            at, scenes, given, DT_S, smoother, np.ones(1), least_mode_spread=least
        ).mean[0, 0]

    # Another mode becomes the heaviest: its own path of the cycle before counts, not the one that
    # was published, which had been moved away from the heaviest of that time.
    plain, spread = PathSmoother(0.5), PathSmoother(0.5)
    for stamp_s, weight in ((0.0, [0.9, 0.1]), (0.5, [0.1, 0.9])):
        expected = published(plain, stamp_s, weight, 0.0)
        np.testing.assert_array_equal(published(spread, stamp_s, weight, 1.0), expected)


def test_a_first_order_model_gets_velocities_from_its_positions():
    mean = [[[[11.0, 0.0], [11.0, 2.0]]]]  # from (10, 0): (1, 0) m, then (0, 2) m in 0.5 s each
    scenes = batch([[1]], [[True]], [[0.0, 0.0]], [0.0])
    prediction = assemble(window(), scenes, output(mean, [[1.0]], np.eye(2)), DT_S)
    assert prediction.mean[1, 0, :, 2:].tolist() == [[2.0, 0.0], [0.0, 4.0]]
    assert prediction.yaw[1, 0] == pytest.approx([0.0, np.pi / 2])


@pytest.mark.parametrize(
    "covariance",
    [
        [[1.0, 1.0], [1.0, 1.0]],  # singular
        [[-1.0, 0.0], [0.0, -1.0]],
        [[np.nan, 0.0], [0.0, 1.0]],
        [[np.inf, 0.0], [0.0, 1.0]],
    ],
)
def test_an_agent_with_one_bad_covariance_has_no_prediction(covariance):
    mean = np.zeros((2, 2, 3, 4))
    scenes = batch([[0, 1]], [[True, True]], [[0.0, 0.0]], [0.0])
    given = output(mean, [[0.5, 0.5]] * 2, np.eye(2))
    given.covariance[0, 1, 2] = covariance
    prediction = assemble(window(2), scenes, given, DT_S)
    for name in ("weight", "mean", "yaw", "covariance"):
        assert np.isnan(getattr(prediction, name)[0]).all()
        assert np.isfinite(getattr(prediction, name)[1]).all()


@pytest.mark.parametrize("name", ["mean", "log_weight"])
def test_an_agent_with_one_value_that_is_not_finite_has_no_prediction(name):
    scenes = batch([[0, 1]], [[True, True]], [[0.0, 0.0]], [0.0])
    given = output(np.zeros((2, 2, 3, 4)), [[0.5, 0.5]] * 2, np.eye(2))
    getattr(given, name)[(1,) + (0,) * (getattr(given, name).ndim - 1)] = np.nan
    prediction = assemble(window(2), scenes, given, DT_S)
    assert np.isfinite(prediction.weight[0]).all()
    assert np.isnan(prediction.mean[1]).all()


def simple_prediction(x):
    """A prediction of three agents whose x is ``x`` + i."""
    scenes = batch([[0, 1, 2]], [[True] * 3], [[x, 0.0]], [0.0])
    mean = [[[[float(i), 0, 1, 0]]] for i in range(3)]
    return assemble(window(), scenes, output(mean, [[1.0]] * 3, np.eye(2)), DT_S)


def test_rows_are_replaced_by_those_of_another_prediction():
    first, other = simple_prediction(0.0), simple_prediction(50.0)
    merged = replace_rows(first, np.array([1]), select(other, np.array([1])))
    assert merged.mean[:, 0, 0, 0].tolist() == [0.0, 51.0, 2.0]
    assert first.mean[:, 0, 0, 0].tolist() == [0.0, 1.0, 2.0]  # unchanged


def test_select_keeps_order_and_everything_of_an_agent():
    some = select(simple_prediction(0.0), np.array([2, 0]))
    assert some.key[:, 0].tolist() == [2, 0]
    assert some.mean[:, 0, 0, 0].tolist() == [2.0, 0.0]
    assert some.initial[:, 0].tolist() == [20.0, 0.0]
    assert some.time_s.tolist() == [DT_S]
    assert len(select(some, np.array([False, False]))) == 0


def test_without_an_agent_the_others_stay_as_they_are():
    whole = simple_prediction(0.0)
    others = without_agent(whole, whole.key[1])
    assert others.key.tolist() == whole.key[[0, 2]].tolist()
    assert without_agent(others, whole.key[1]) is others
    assert without_agent(whole, None) is whole
    nothing = select(whole, np.array([], dtype=int))
    assert len(without_agent(nothing, whole.key[0])) == 0


def test_another_time_origin_moves_the_stamp_and_not_the_instants():
    prediction = simple_prediction(0.0)
    moved = with_time_origin(prediction, prediction.stamp_ns - 300_000_000)
    assert moved.stamp_ns == -300_000_000
    assert moved.time_s == pytest.approx([0.8])
    assert moved.mean is prediction.mean
    assert with_time_origin(prediction, prediction.stamp_ns) is prediction


def test_the_state_at_the_stamp_moves_with_the_time_origin():
    prediction = simple_prediction(0.0)
    state = np.array([[10.0, 20.0, 5.0, -2.0]] * 3)
    moved = with_time_origin(dataclasses.replace(prediction, initial=state), -300_000_000)
    assert moved.initial == pytest.approx(np.array([[8.5, 20.6, 5.0, -2.0]] * 3))
    back = with_time_origin(moved, 0)
    assert back.initial == pytest.approx(state)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("delay_s", [0.0, 0.0471])
@pytest.mark.parametrize("step_s", [0.2, 1.0 / 30.0])
def test_the_time_grid_is_that_of_the_model_whatever_the_delay(kind, delay_s, step_s):
    time_s = (delay_s + step_s * np.arange(1, 26)).astype(kind).astype(np.float64)
    assert time_grid(time_s) == pytest.approx((delay_s, step_s), abs=1e-6)
    assert time_grid(time_s)[1] == pytest.approx(step_s, abs=1e-8)
    time_s[[0, 7, 24]] = np.nan  # steps whose points are missing
    assert time_grid(time_s) == pytest.approx((delay_s, step_s), abs=1e-6)


def test_the_time_grid_of_one_step_or_none():
    assert time_grid(np.array([0.2])) == (0.0, 0.2)
    assert time_grid(np.array([np.nan, 0.4])) == (0.0, 0.2)
    delay_s, step_s = time_grid(np.array([np.nan]))
    assert delay_s == 0.0
    assert np.isnan(step_s)


def test_a_compensated_delay_is_taken_off_the_times():
    prediction = dataclasses.replace(simple_prediction(0.0), time_s=np.array([0.25, 0.45]))
    started = from_horizon_start(prediction)
    assert started.stamp_ns == prediction.stamp_ns + 50_000_000 == delay_ns(prediction)
    assert started.time_s == pytest.approx([0.2, 0.4])
    assert from_horizon_start(started) is started
