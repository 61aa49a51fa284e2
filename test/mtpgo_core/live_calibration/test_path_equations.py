# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The linear function that is fitted to errors of paths, and how far it is believed."""

import numpy as np
import pytest

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.live_calibration.path_equations import (
    ANY,
    KINDS,
    PathEquations,
    PathErrors,
    PathFit,
    kinds,
)
from mtpgo_core.live_calibration.path_features import FEATURES
from mtpgo_core.schema import AgentClass
from mtpgo_core.task.calibration import calibration_groups

VEHICLE, PEDESTRIAN = 0, 2
ALONG, ACROSS = 0, 1
STEPS = 5


@pytest.fixture
def equations():
    return PathEquations(LiveOptions(), 0.2, STEPS)


SIGMA_M = 5.0


def begun(equations, coefficients, belief, information=1e9):
    """What is begun with, learned from so much of all features alike."""
    shape = equations.fit.information.shape
    return PathFit.begun(
        coefficients, belief, np.broadcast_to(information * np.eye(FEATURES), shape)
    )


def feed(equations, slope, *, seconds=120, kind=VEHICLE, agents=10, noise_m=0.0, seed=0):
    """Let errors be a slope times the first feature (along) and half of it (across)."""
    rng = np.random.default_rng(seed)
    for _ in range(seconds):
        features = np.zeros((agents, 2, FEATURES))
        features[..., :2] = rng.normal(size=(agents, 2, 2))
        own = np.full(agents, kind)
        proposal = equations.fit.propose(own, features, equations.fit.shares(own, features))
        wanted = slope * features[..., 0] * np.array([1.0, 0.5])
        for step in range(STEPS):
            equations.add(
                PathErrors(
                    kind=np.full(agents, kind),
                    step=np.full(agents, step),
                    weight=np.ones(agents),
                    features=features,
                    error=(step + 1) * wanted + rng.normal(scale=noise_m, size=(agents, 2)),
                    sigma=np.full((agents, 2), SIGMA_M),
                    proposal=proposal[:, step],
                )
            )
        equations.pass_time(1.0)


def test_what_errors_depend_on_is_found_by_step_and_direction(equations):
    feed(equations, 0.3)
    found = equations.fit
    steps = np.arange(1, STEPS + 1)
    for axis, share in ((ALONG, 1.0), (ACROSS, 0.5)):
        first = found.coefficients[VEHICLE, axis, :, 0]
        np.testing.assert_allclose(first, 0.3 * share * steps, rtol=0.02)
    assert np.abs(found.coefficients[VEHICLE, ..., 1:]).max() < 0.01
    assert (found.belief[VEHICLE] > 0.9).all()
    # The one for unknown classes learns from all, that of another class nothing.
    np.testing.assert_allclose(found.coefficients[ANY], found.coefficients[VEHICLE])
    assert not found.coefficients[PEDESTRIAN].any()
    assert not found.belief[PEDESTRIAN].any()


def test_errors_of_unknown_classes_count_once(equations):
    feed(equations, 0.3, kind=ANY)
    other = PathEquations(LiveOptions(), 0.2, STEPS)
    feed(other, 0.3, kind=VEHICLE)
    np.testing.assert_allclose(equations.fit.coefficients[ANY], other.fit.coefficients[ANY])
    assert not equations.fit.coefficients[VEHICLE].any()


def test_proposals_out_of_noise_are_not_believed(equations):
    feed(equations, 0.0, noise_m=1.0, seconds=60)
    fit = equations.fit
    assert np.abs(fit.coefficients[VEHICLE]).max() > 0.0
    assert (fit.belief[VEHICLE] < 0.5).all()
    assert np.abs(fit.belief[..., None] * fit.coefficients).max() < 0.05


def test_nothing_is_believed_at_once(equations):
    feed(equations, 0.03, seconds=1, agents=2)
    assert not equations.fit.belief.any()  # nothing was proposed before
    feed(equations, 0.03, seconds=5, agents=2)
    few = equations.fit.belief[VEHICLE, ALONG, -1]
    feed(equations, 0.03, seconds=600, agents=2)
    assert 0.0 < few < 0.5 < equations.fit.belief[VEHICLE, ALONG, -1]


def test_what_turns_round_is_followed_and_not_believed_meanwhile():
    equations = PathEquations(LiveOptions(memory_s=60.0), 0.2, STEPS)
    feed(equations, 0.3, seconds=120)
    before = equations.fit
    feed(equations, -0.3, seconds=30, seed=1)
    between = equations.fit
    assert (between.belief[VEHICLE, ALONG] < before.belief[VEHICLE, ALONG]).all()
    feed(equations, -0.3, seconds=300, seed=2)
    assert (equations.fit.coefficients[VEHICLE, ALONG, :, 0] < 0.0).all()
    assert (equations.fit.belief[VEHICLE, ALONG] > 0.8).all()


def test_without_outcomes_what_was_learned_is_forgotten_towards_what_was_begun_with(equations):
    feed(equations, 0.3)
    for _ in range(20):
        equations.pass_time(600.0)
    assert np.abs(equations.fit.coefficients).max() < 0.05
    assert equations.fit.belief.max() < 0.1

    rng = np.random.default_rng(1)
    shape = equations.fit.coefficients.shape
    begin = begun(equations, rng.normal(size=shape), rng.uniform(size=shape[:-1]))
    again = PathEquations(LiveOptions(), 0.2, STEPS)
    again.begin_with(begin)
    again.pass_time(1.0)
    np.testing.assert_allclose(again.fit.coefficients, begin.coefficients)
    np.testing.assert_allclose(again.fit.belief, begin.belief)
    feed(again, 0.3)
    steps = np.arange(1, STEPS + 1)
    np.testing.assert_allclose(again.fit.coefficients[VEHICLE, ALONG, :, 0], 0.3 * steps, rtol=0.1)
    np.testing.assert_allclose(again.fit.coefficients[PEDESTRIAN], begin.coefficients[PEDESTRIAN])


def test_motorcycles_are_a_kind_of_their_own():
    classes = (AgentClass.CAR, AgentClass.BICYCLE, AgentClass.MOTORCYCLE, AgentClass.UNKNOWN)
    agent_class = np.array(classes, dtype=np.uint8)
    group = calibration_groups(agent_class, np.full((4, 2), 5.0))
    found = [KINDS[kind] for kind in kinds(agent_class, group)]
    assert found == ["vehicle", "two_wheeler", "motorcycle", "any"]


def test_nothing_to_learn_from_changes_nothing(equations):
    equations.add(
        PathErrors(
            kind=np.empty(0, dtype=np.intp),
            step=np.empty(0, dtype=np.intp),
            weight=np.empty(0),
            features=np.empty((0, 2, FEATURES)),
            error=np.empty((0, 2)),
            sigma=np.empty((0, 2)),
            proposal=np.empty((0, 2)),
        )
    )
    equations.pass_time(2.0)
    assert not equations.fit.coefficients.any()


def test_what_was_learned_holds_less_for_features_unlike_those_it_was_learned_from(equations):
    feed(equations, 0.3)
    features = np.zeros((3, 2, FEATURES))
    features[:, :, 0] = 1.0
    features[1, :, 0] = 100.0  # much larger than all before
    features[2, :, 5] = 1.0  # never seen
    kind = np.full(3, VEHICLE)
    shares = equations.fit.shares(kind, features)
    assert (shares[0] > 0.95).all()
    assert (shares[1:] < 0.6).all()
    assert (shares > 0.0).all()
    proposal = equations.fit.propose(kind, features, shares)
    np.testing.assert_allclose(proposal[0, :, ALONG], 0.3 * np.arange(1, STEPS + 1), rtol=0.1)
    plain = equations.fit.propose(kind, features, np.ones_like(shares))
    np.testing.assert_allclose(proposal, shares * plain)
    # Nothing was learned of pedestrians.
    assert not equations.fit.propose(np.full(3, PEDESTRIAN), features, shares).any()


def test_what_was_begun_with_holds_for_features_like_those_it_was_learned_from(equations):
    """As before a restart: the file has what it was learned from."""
    feed(equations, 0.3)
    before = equations.fit
    again = PathEquations(LiveOptions(), 0.2, STEPS)
    again.begin_with(PathFit.begun(before.coefficients, before.belief, before.information))
    features = np.zeros((2, 2, FEATURES))
    features[0, :, 0], features[1, :, 0] = 1.0, 100.0
    kind = np.full(2, VEHICLE)
    for fit in (again.fit, before):
        shares = fit.shares(kind, features)
        proposal = fit.propose(kind, features, shares)
        expected = 0.3 * np.arange(1, STEPS + 1)
        np.testing.assert_allclose(proposal[0, :, ALONG], expected, rtol=0.1)
        assert (shares[1] < 0.6).all()
    again.pass_time(1.0)
    np.testing.assert_allclose(again.fit.shares(kind, features), shares, rtol=0.05)
    np.testing.assert_allclose(again.fit.coefficients, before.coefficients, atol=1e-9)


def exact(equations, seconds, error_m, noise_m=0.02, kind=VEHICLE):
    """Road users with equal features and errors."""
    rng = np.random.default_rng(1)
    features = np.zeros((8, 2, FEATURES))
    features[..., 0] = 1.0
    kind = np.broadcast_to(kind, 8)
    error = np.broadcast_to(error_m, 8)[:, None]
    for _ in range(seconds):
        fit = equations.fit
        proposal = fit.propose(kind, features, fit.shares(kind, features))
        for step in range(STEPS):
            equations.add(
                PathErrors(
                    kind=kind,
                    step=np.full(8, step),
                    weight=np.ones(8),
                    features=features,
                    error=error + rng.normal(scale=noise_m, size=(8, 2)),
                    sigma=np.full((8, 2), SIGMA_M),
                    proposal=proposal[:, step],
                )
            )
        equations.pass_time(1.0)
    fit = equations.fit
    proposal = fit.propose(kind, features, fit.shares(kind, features))
    return (fit.belief[kind] * proposal.transpose(0, 2, 1))[:, ALONG]


def test_what_is_right_no_more_is_soon_believed_no_more(equations):
    """After twenty minutes of an error of a metre, as of a sensor, the paths are right."""
    assert exact(equations, 1200, 1.0).min() > 0.9
    assert np.abs(exact(equations, 60, 0.0)).max() < 0.3
    assert np.abs(exact(equations, 120, 0.0)).max() < 0.1
    assert exact(equations, 300, 1.0).min() > 0.7  # and it comes back


def test_proposals_for_cars_say_nothing_of_road_users_of_no_known_class(equations):
    kind = np.array([ANY, ANY, *[VEHICLE] * 6])
    applied = exact(equations, 300, np.where(kind == ANY, 0.0, 3.0), kind=kind)
    assert (applied[kind == VEHICLE] > 2.5).all()
    assert np.abs(applied[kind == ANY]).max() < 0.5


def test_steps_that_are_never_observed_follow_those_that_are():
    """As with observations once a second; what lies beyond all that is known counts as 0."""
    ahead = np.arange(1, 26) / 25
    wanted = 0.5 * ahead - 0.3 * ahead**2
    once_a_second = np.isin(np.arange(25), [4, 9, 14, 19, 24])
    begun_lately = np.isin(np.arange(25), [4, 9])
    found = []
    for known in (np.ones(25, dtype=np.bool_), once_a_second, begun_lately):
        belief = np.broadcast_to(known, (len(KINDS), 2, 25)).astype(np.float64)
        information = np.broadcast_to(np.eye(FEATURES), (len(KINDS), 2, 3, FEATURES, FEATURES))
        fit = PathFit.begun(np.zeros((*belief.shape, FEATURES)), belief, information)
        shift = np.where(known, wanted, 0.0)[None, None, :, None] * np.array([1.0, 2.0])
        found.append(fit.as_curves(np.array([VEHICLE]), shift)[0, 0])
    for one in found[:2]:
        np.testing.assert_allclose(one, wanted[:, None] * np.array([1.0, 2.0]), atol=1e-9)
    assert np.abs(found[2][20:, 0]).max() < 0.25 * wanted.max()
