# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The occupancy of cells against samples, windows of time, and what is unknown."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import rotate, rotate_covariance
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.risk.predicted_occupancy import GridShape, predicted_occupancy, unknown_field
from mtpgo_core.schema import Prediction

SHAPE = GridShape(side=20.0, resolution=0.5)


def prediction(x=(0.0,), *, sigma_m=(1.0, 0.4), yaw=0.0, turn=0.0, weight=(1.0,), time_s=(1.0,)):
    """Return one agent per place on the x axis, with the same modes and steps."""
    n, modes, steps = len(x), len(weight), len(time_s)
    mean = np.zeros((n, modes, steps, 4))
    mean[..., 0] = np.array(x)[:, None, None]
    spread = rotate_covariance(np.diag(sigma_m)[None] ** 2, np.array([yaw + turn]))[0]
    return Prediction(
        stamp_ns=0,
        frame_id="map",
        key=keys_from_integers(range(n)),
        agent_class=np.ones(n, np.uint8),
        z=np.zeros(n),
        size=np.tile([4.0, 2.0], (n, 1)),
        initial=np.full((n, 4), np.nan),
        initial_yaw=np.zeros(n),
        time_s=np.array(time_s),
        weight=np.tile(weight, (n, 1)),
        mean=mean,
        yaw=np.full((n, modes, steps), yaw),
        covariance=np.broadcast_to(spread, (n, modes, steps, 2, 2)).copy(),
        source=np.zeros(n, np.uint8),
    )


@pytest.mark.parametrize(("yaw", "turn"), [(0.0, 0.0), (0.7, 0.0), (-1.2, 0.5), (2.0, 1.0)])
def test_samples_agree(yaw, turn):
    """The boxes of samples, widened by half a cell, cover the middles of cells."""
    given = prediction(yaw=yaw, turn=turn)
    field = predicted_occupancy(given, SHAPE, np.zeros(2), 1.0, 1.0)
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(2000, 2)) @ np.linalg.cholesky(given.covariance[0, 0, 0]).T
    axis = np.arange(SHAPE.cells) + 0.5
    middles = field.corner + SHAPE.resolution * np.stack(np.meshgrid(axis, axis), axis=-1)
    wanted = np.zeros(field.probability.shape)
    chosen = np.argwhere(np.hypot(*np.moveaxis(middles, -1, 0)) < 6.0)[::3]
    for place in chosen:
        inside = rotate(middles[tuple(place)] - samples, -yaw)
        wanted[tuple(place)] = (np.abs(inside) <= (2.25, 1.25)).all(axis=1).mean()
    # 0.04 is the noise of the samples; the rest is the correlation's (turn), see the function.
    error = np.abs(field.probability - wanted)[tuple(chosen.T)]
    assert error.max() < (0.04 if turn == 0.0 else 0.06)
    assert error.mean() < 0.01


def test_cells_lie_on_multiples_of_the_resolution_around_the_middle():
    corner = SHAPE.corner(np.array([3.3, -7.1]))
    np.testing.assert_allclose(np.mod(corner, 0.5), 0.0, atol=1e-12)
    assert np.abs(corner + 10.0 - (3.3, -7.1)).max() <= 0.25


def test_rows_are_along_y_and_what_is_outside_is_left_out():
    given = prediction((9.5, 500.0), sigma_m=(0.1, 0.1))
    given.mean[0, :, :, 1] = -3.0
    field = predicted_occupancy(given, SHAPE, np.zeros(2), 1.0, 1.0)
    rows, columns = np.nonzero(field.probability > 0.9)
    y, x = field.corner[1] + 0.5 * rows, field.corner[0] + 0.5 * columns
    assert (y > -4.5).all()
    assert (y < -1.5).all()
    assert (x > 7.0).all()
    assert field.probability.shape == (40, 40)


def test_the_highest_of_the_steps_in_the_window_counts():
    given = prediction(time_s=(0.5, 1.0, 2.0), sigma_m=(0.1, 0.1))
    given.mean[0, 0, :, 0] = (-7.0, 0.0, 7.0)
    middle = SHAPE.cells // 2

    def covered(begin_s, end_s):
        field = predicted_occupancy(given, SHAPE, np.zeros(2), begin_s, end_s)
        return [bool(field.probability[middle, middle + 2 * x] > 0.9) for x in (-7, 0, 7)]

    assert covered(0.0, 1.0) == [True, True, False]
    assert covered(1.0, 1.0) == [False, True, False]
    assert covered(0.0, 9.0) == [True, True, True]
    assert covered(1.4, 1.4) == [False, True, False]  # no step there: the nearest
    assert covered(2.4, 9.0) == [False, False, True]  # the last step stands for a while


def test_a_window_beyond_the_predictions_is_unknown():
    field = predicted_occupancy(prediction(time_s=(1.0, 2.0)), SHAPE, np.zeros(2), 2.6, 9.0)
    assert field.begins_beyond
    assert np.isnan(field.probability).all()
    empty = predicted_occupancy(prediction((), time_s=()), SHAPE, np.zeros(2), 2.6, 9.0)
    assert not empty.begins_beyond
    assert (empty.probability == 0.0).all()


def test_modes_weigh_and_road_users_add_up():
    half = predicted_occupancy(
        prediction(weight=(0.5, 0.5), sigma_m=(0.01, 0.01)), SHAPE, np.zeros(2), 1.0, 1.0
    )
    assert half.probability.max() == pytest.approx(1.0, abs=1e-3)
    apart = prediction(weight=(0.7, 0.3), sigma_m=(0.01, 0.01))
    apart.mean[0, 1, :, 0] = 6.0
    field = predicted_occupancy(apart, SHAPE, np.zeros(2), 1.0, 1.0)
    np.testing.assert_allclose(field.probability[20, [20, 32]], [0.7, 0.3], atol=1e-3)
    two = predicted_occupancy(prediction((0.0, 0.0)), SHAPE, np.zeros(2), 1.0, 1.0)
    assert two.probability.max() <= 1.0


def test_an_agent_that_is_not_finite_makes_the_field_unknown():
    given = prediction((0.0, 5.0))
    for value in (np.nan, 1e38):  # of the latter every cell would be free
        given.covariance[1] = value * np.eye(2)
        field = predicted_occupancy(given, SHAPE, np.zeros(2), 1.0, 1.0)
        assert np.isnan(field.probability).all()
        assert field.unknown_agents == 1
    assert np.isnan(unknown_field(SHAPE, np.zeros(2)).probability).all()


def test_a_grid_that_would_take_too_long_is_unknown():
    wide = prediction(np.zeros(20), sigma_m=(3000.0, 3000.0))
    shape = GridShape(1000.0, 0.5)
    field = predicted_occupancy(wide, shape, np.zeros(2), 1.0, 1.0)
    assert field.too_many_cells == 20 * 2000**2
    assert np.isnan(field.probability).all()


def test_an_agent_whose_modes_are_not_complete_makes_the_field_unknown():
    lacking = prediction(weight=(0.7, 0.2))
    assert predicted_occupancy(lacking, SHAPE, np.zeros(2), 1.0, 1.0).unknown_agents == 1
    none = prediction(weight=(0.0,))
    assert predicted_occupancy(none, SHAPE, np.zeros(2), 1.0, 1.0).unknown_agents == 1


def test_an_empty_road_is_known_to_be_free():
    given = prediction((0.0,))
    nothing = {
        f.name: getattr(given, f.name)[:0]
        for f in dataclasses.fields(given)
        if f.name not in ("stamp_ns", "frame_id", "time_s")
    }
    field = predicted_occupancy(
        dataclasses.replace(given, **nothing), SHAPE, np.zeros(2), 0.0, 2.0
    )
    assert (field.probability == 0.0).all()


def test_a_grid_of_no_size_is_refused():
    with pytest.raises(ConfigurationError, match="resolution is 0"):
        GridShape(resolution=0.0)
