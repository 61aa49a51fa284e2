# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Factors on standard deviations follow the share of misses, and no single road user."""

import numpy as np
import pytest
from live_stream import GROUP, ErrorStream

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.sigma_tracker import (
    POOLS,
    SIGMA_LIMITS,
    SigmaTracker,
    SquaredErrors,
)
from mtpgo_core.quality.metrics import radius_squared, sigma_factor
from mtpgo_core.task.calibration import GROUPS, SIGMA_FACTOR_50_LIMITS

PEDESTRIANS = GROUPS.index("pedestrian_moving")


def test_right_covariances_keep_their_factors():
    stream = ErrorStream()
    assert (stream.sigma() == 1.0).all()
    stream.run(120)
    assert stream.sigma() == pytest.approx(1.0, abs=0.2)
    np.testing.assert_allclose(stream.coverage(60), [0.5, 0.9], atol=0.04)


@pytest.mark.parametrize("scale", [0.4, 3.0])
@pytest.mark.parametrize("heavy", [False, True])
def test_both_ellipses_hold_what_they_should_after_a_minute(scale, heavy):
    stream = ErrorStream()
    stream.run(60, scale=scale, heavy=heavy)
    stream.run(120, scale=scale, heavy=heavy)
    half, most = stream.coverage(120)
    assert 0.44 < half < 0.56
    assert 0.87 < most < 0.93
    if heavy:  # a Gaussian with the right 90 % ellipse would hold more than half in the inner one
        assert (stream.sigma(level=0) < 0.85 * stream.sigma(level=1)).all()


def test_a_shipped_50_percent_ellipse_that_is_right_keeps_its_factor():
    """Errors with heavy tails; without the shipped factor the inner ellipse has to be learned."""
    learned, shipped = ErrorStream(seed=2), ErrorStream(seed=2, shipped_50=0.75)
    for stream in (learned, shipped):
        stream.run(240, scale=0.77, heavy=True)
    assert (learned.sigma(level=0) < 0.85).all()
    assert shipped.sigma(level=0) == pytest.approx(1.0, abs=0.15)
    np.testing.assert_allclose(
        0.75 * shipped.sigma(level=0), learned.sigma(level=0), rtol=0.1
    )  # in the end both are the same
    np.testing.assert_allclose(shipped.coverage(180), [0.5, 0.9], atol=0.04)


@pytest.mark.parametrize("agents", [10, 30])
def test_doubled_noise_is_followed_within_a_minute(agents):
    stream = ErrorStream(agents, seed=1)
    stream.run(120)
    stream.run(60, scale=2.0)
    assert stream.sigma() == pytest.approx(2.0, rel=0.2)
    stream.run(60, scale=2.0)
    assert 0.86 < stream.coverage(60)[1] < 0.94


@pytest.mark.parametrize("heavy", [False, True])
def test_one_erratic_road_user_of_thirty_moves_no_factor_by_a_tenth(heavy):
    calm, disturbed = ErrorStream(), ErrorStream()
    for erratic, stream in (((), calm), ((7,), disturbed)):
        stream.run(160, heavy=heavy, erratic=erratic)
    apart = np.abs(np.array(disturbed.log) - np.array(calm.log))
    assert 0.0 < apart.max() < np.log(1.1)


@pytest.mark.parametrize(("pedestrians", "most"), [(1, 0.1), (3, 0.15)])
def test_nor_does_one_of_few_pedestrians_where_there_are_thirty_road_users(pedestrians, most):
    """Such a group has its factors of one or two other road users only."""
    apart = 0.0
    calm, disturbed = ErrorStream(), ErrorStream()
    for stream in (calm, disturbed):
        stream.group[:pedestrians] = PEDESTRIANS
    for _ in range(10):
        calm.run(8)
        disturbed.run(8, erratic=(0,))
        ratio = disturbed.sigma(group=PEDESTRIANS) / calm.sigma(group=PEDESTRIANS)
        apart = max(apart, np.abs(np.log(ratio)).max())
    assert 0.0 < apart < np.log(1.0 + most)


def test_factors_stay_within_their_limits():
    stream = ErrorStream()
    stream.run(60, scale=100.0)
    assert stream.sigma() == pytest.approx(SIGMA_LIMITS[1])
    stream = ErrorStream()
    stream.run(90, scale=1e-3)
    assert stream.sigma() == pytest.approx(SIGMA_LIMITS[0])


def test_groups_with_few_road_users_move_along_with_all():
    stream = ErrorStream()
    stream.run(60, scale=2.0)
    assert stream.sigma(group=PEDESTRIANS) == pytest.approx(
        stream.sigma(group=POOLS + 1), rel=0.05
    )
    standing = 0  # another motion is another kind of error
    assert (stream.sigma(group=standing) == 1.0).all()


def test_groups_with_enough_road_users_do_not_depend_on_others():
    calm, disturbed = ErrorStream(agents=20), ErrorStream(agents=20)
    for stream, erratic in ((calm, ()), (disturbed, range(10))):
        stream.group[10:] = PEDESTRIANS
        stream.run(20, erratic=erratic)  # cars
    np.testing.assert_allclose(disturbed.sigma(group=PEDESTRIANS), calm.sigma(group=PEDESTRIANS))
    assert (disturbed.sigma() > calm.sigma()).all()


def test_road_users_of_a_group_are_counted_over_twenty_seconds():
    """Ten cars per prediction for long, and then ten pedestrians for 20 s."""
    stream = ErrorStream(agents=10)
    stream.run(200)
    stream.group[:] = PEDESTRIANS
    stream.run(20)
    assert stream.tracker.agents[GROUP] == pytest.approx(10.0 * np.exp(-1.0), rel=1e-3)
    assert stream.tracker.agents[PEDESTRIANS] == pytest.approx(
        10.0 - 10.0 * np.exp(-1.0), rel=1e-3
    )
    assert stream.tracker.agents[POOLS + 1] == pytest.approx(10.0)


def test_unknown_class_is_the_pool():
    stream = ErrorStream(group=POOLS + 1)
    stream.run(60, scale=2.0)
    assert stream.sigma(group=POOLS + 1) == pytest.approx(2.0, rel=0.2)


def test_what_nobody_confirms_is_forgotten():
    stream = ErrorStream(options=LiveOptions(memory_s=100.0))
    stream.run(60, scale=2.0)
    learned = stream.sigma()
    stream.tracker.pass_time(11.0)
    for _ in range(100):
        stream.tracker.pass_time(5.0)
    assert (learned > 1.5).all()
    assert stream.sigma() == pytest.approx(1.0, abs=0.05)


def test_constant_velocity_learns_where_the_model_did_not_predict():
    stream = ErrorStream()
    stream.run(60, scale=2.0, predicted=False)
    assert (stream.sigma(source=0) == 1.0).all()
    assert stream.sigma(source=1) == pytest.approx(2.0, rel=0.2)


def test_rates_can_be_replaced_while_it_runs():
    slow, fast = ErrorStream(), ErrorStream()
    fast.tracker.options = LiveOptions(rate_90=0.44, rate_50=0.48, track_limit=1.0)
    for stream in (slow, fast):
        stream.run(4, scale=3.0)
    assert np.log(fast.sigma()).min() > 2.0 * np.log(slow.sigma()).max() > 0.0


def test_what_a_track_has_changed_is_forgotten_in_the_time_of_the_present_options():
    long, short = ErrorStream(), ErrorStream()
    for stream, seconds in ((long, 60.0), (short, 1.0)):
        stream.tracker.options = LiveOptions(track_memory_s=seconds, track_limit=0.003)
        stream.run(20, scale=3.0)
    assert np.log(short.sigma()).min() > 2.0 * np.log(long.sigma()).max() > 0.0


def test_ellipses_of_all_levels_lie_within_each_other_at_any_ratio_of_the_two():
    level = np.linspace(0.01, 0.999, 400)
    plain = np.sqrt([radius_squared(p) for p in level])
    smallest = SIGMA_LIMITS[0] / SIGMA_LIMITS[1]
    for ratio in np.geomspace(smallest, SIGMA_FACTOR_50_LIMITS[1], 9):
        radius = plain * [sigma_factor(p, ratio) for p in level]
        assert (np.diff(radius) > 0.0).all()


@pytest.mark.parametrize(("agents", "close"), [(2, 0.03), (20, 0.015)])
def test_the_long_run_coverage_of_heavy_tails_that_become_known_five_seconds_later(agents, close):
    """Road users that come and go, whose errors (Student's t, three degrees) last for seconds."""
    rng, tracker, dt_s, delay = np.random.default_rng(3), SigmaTracker(LiveOptions(), 1), 0.4, 12
    error, tail, track = rng.normal(size=(agents, 2)), np.ones(agents), np.arange(agents)
    keep, number, kept, inside = np.exp(-dt_s / 2.0), agents, [], []
    for cycle in range(1500):
        error = keep * error + np.sqrt(1.0 - keep**2) * rng.normal(size=error.shape)
        if cycle % 25 == 0:
            tail = rng.chisquare(3, size=agents) / 3
        new = rng.random(agents) < dt_s / 40.0
        track, number = np.where(new, number + np.arange(agents), track), number + agents
        squared = 9.0 * (error**2).sum(axis=1) / tail
        kept.append((tracker.log_sigma[:, :, :, 0], track))
        tracker.pass_time(dt_s)
        if cycle < delay:
            continue
        table, predicted = kept[cycle - delay]
        rows = np.flatnonzero(predicted == track)
        served = [table[:, :, group] for group in (1, POOLS + 1)]
        radius = np.sqrt([radius_squared(p) for p in (0.5, 0.9)]) * np.exp(served[0][0])
        inside += (np.sqrt(squared[rows])[:, None] <= radius).tolist()
        m = len(rows)
        tracker.update(
            SquaredErrors(
                track=track[rows],
                group=np.full(m, 1),
                step=np.zeros(m, dtype=int),
                cycle=np.full(m, cycle),
                span_s=np.full(m, dt_s),
                squared=np.stack([squared[rows]] * 2, axis=1),
                shipped_50=np.zeros((m, 2)),
                own=np.tile(served[0], (m, 1, 1)),
                pool=np.tile(served[1], (m, 1, 1)),
            )
        )
    later = np.array(inside[len(inside) // 5 :])
    np.testing.assert_allclose(later.mean(axis=0), [0.5, 0.9], atol=close)
