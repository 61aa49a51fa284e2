# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The values of single agents, with known errors and spreads."""

import numpy as np
import pytest
from known_paths import DT, TIME, H, agents, paths

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.manoeuvres import MANOEUVRES
from mtpgo_training.evaluation.honesty.agent_honesty import PredictedPaths, agent_honesty

STAYS = 1 << MANOEUVRES.index("standing")


def values(given, **options):
    return agent_honesty(given, DT, **options)


def test_coverage_and_likelihood_of_a_known_error():
    found = values(paths(agents(2), error_m=2.0))
    for time_s in (1, 3, 5):
        # Two standard deviations off is in the ellipses from 1 - exp(-2) = 86.5 % on.
        for kind in ("ellipse", "region"):
            inside = [found[f"{kind}_{percent}_{time_s}s"].tolist() for percent in (50, 90, 95)]
            assert inside == [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]
        assert found[f"nll_{time_s}s"] == pytest.approx(np.log(2 * np.pi) + 2.0)
        assert found[f"squared_error_{time_s}s"] == pytest.approx(4.0)
        assert found[f"variance_{time_s}s"] == pytest.approx(2.0)


def test_the_mixture_may_hold_what_its_heaviest_mode_misses():
    given = paths(agents(1), error_m=10.0, apart_m=-10.0, weight=(0.6, 0.4))
    found = values(given)
    assert (found["ellipse_95_5s"], found["region_95_5s"]) == (0.0, 1.0)
    assert found["region_50_5s"] == 1.0  # its level is 0.6 * (1 - 0.4 / 0.6) = 0.2


def test_what_was_not_observed_and_baselines_without_covariance_are_not_judged():
    found = values(paths(agents(1), known=20, weight=(0.6, 0.4)))
    assert found["ellipse_90_3s"] == 1.0
    for name in ("ellipse_90_5s", "region_90_5s", "nll_5s", "variance_5s", "squared_error_5s"):
        assert np.isnan(found[name]), name
    weights = ("brier", "heaviest_nearest", "chance", "brier_min_fde", "brier_min_ade")
    for name in (*weights, "bin_count_0"):
        assert np.isnan(found[name]), name
    bare = values(paths(agents(1), sigma_m=None))
    assert np.isnan([bare["ellipse_90_1s"], bare["nll_1s"], bare["variance_1s"]]).all()
    assert bare["squared_error_5s"] == 0.0
    assert np.isnan([bare["brier"], bare["mode_distance"], bare["chance"]]).all()


def test_without_a_known_start_a_path_is_not_judged():
    given = [paths(agents(2)), paths(agents(2, speed=0.0, bits=STAYS), speed=0.0)]
    moving, standing = (values(one) for one in given)
    assert moving["reverses"].tolist() == standing["creeps"].tolist() == [0.0, 0.0]
    for one in given:
        one.start[1], one.yaw[1] = np.nan, np.nan
    moving, standing = (values(one) for one in given)
    for found in (moving["reverses"], standing["creep"], standing["creeps"], moving["overlaps"]):
        assert found[0] == 0.0
        assert np.isnan(found[1])
    assert moving["agents"].tolist() == [1.0, 1.0]


def test_a_horizon_that_is_too_short_or_has_other_steps_has_no_value():
    given = paths(agents(1))
    short = agent_honesty(given, 0.04)  # 25 steps of 0.04 s
    assert short["ellipse_90_1s"] == 1.0
    assert np.isnan([short["ellipse_90_3s"], short["squared_error_2s"]]).all()
    assert np.isnan(agent_honesty(given, 0.3)["ellipse_90_1s"])  # no step at 1 s


def test_weights_and_diversity():
    found = values(paths(agents(1), error_m=4.0, apart_m=-4.0, weight=(0.7, 0.3)))
    assert found["brier"] == pytest.approx(2 * 0.7**2)
    assert (found["heaviest_nearest"], found["chance"]) == (0.0, 0.5)
    assert found["brier_min_fde"] == pytest.approx(0.7**2)
    assert found["brier_min_ade"] == pytest.approx(0.7**2)
    assert found["mode_distance"] == pytest.approx(2 * 0.7 * 0.3 * 4.0)
    assert found["weight_near_heaviest"] == pytest.approx(0.7)
    assert [found["bin_nearest_7"], found["bin_nearest_3"]] == [0.0, 1.0]


def test_modes_are_as_far_apart_as_at_the_end_of_the_horizon():
    given = paths(agents(1), weight=(0.7, 0.3))
    given.mean[:, 1, :, 1] += 0.8 * TIME  # 4 m aside after 5 s, 0.16 m after the first step
    found = values(given)
    assert found["mode_distance"] == pytest.approx(2 * 0.7 * 0.3 * 4.0)
    assert found["weight_near_heaviest"] == pytest.approx(0.7)


def test_fallback_predictions_of_a_model_have_no_weights_to_judge():
    given = paths(agents(2), weight=(1.0, 0.0))
    given.by_model[1] = False
    found = values(given)
    assert np.isfinite(found["brier"]).tolist() == [True, False]
    assert np.isfinite(found["bin_count_9"]).tolist() == [True, False]
    assert np.isfinite(found["ellipse_90_5s"]).all()


def test_only_standing_agents_that_stay_can_creep():
    speeds_and_bits = [(0.0, STAYS), (0.0, 0), (10.0, 0)]
    parts = [
        paths(agents(1, speed=speed, bits=bits, first=i), speed=0.2, error_m=0.0)
        for i, (speed, bits) in enumerate(speeds_and_bits)
    ]
    found = values(PredictedPaths.joined(parts))
    np.testing.assert_allclose(found["creep"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(found["creeps"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(found["reverses"], [np.nan, np.nan, 0.0])


@pytest.mark.parametrize(("kind", "judged"), [(AgentClass.CAR, True), (AgentClass.BICYCLE, False)])
def test_only_vehicles_can_reverse_or_corner_too_fast(kind, judged):
    given = paths(agents(1, kind=kind))
    given.mean[:, 0, :, 0] = 10.0 * TIME - 3.0 * TIME**2
    given.mean[:, 0, :, 1] = 0.5 * TIME**2
    found = values(given)
    for name in ("reverses", "lateral_4", "lateral_8"):
        assert np.isfinite(found[name][0]) == judged
    if judged:
        assert found["reverses"] == 1.0
        assert 0.0 <= found["lateral_8"][0] < found["lateral_4"][0] < 1.0


@pytest.mark.parametrize(("kind", "judged"), [(AgentClass.CAR, True), (AgentClass.BICYCLE, False)])
def test_the_truth_has_a_lateral_acceleration_of_its_own(kind, judged):
    given = paths(agents(1, kind=kind), known=15)
    angle = 0.5 * TIME[:14]  # a circle of 20 m at 10 m/s: 5 m/s^2, then straight on
    given.truth[:, :14] = 20.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    given.truth[:, 14] = 2.0 * given.truth[:, 13] - given.truth[:, 12]
    given.truth[:, 15:] = 0.0  # not observed
    found = values(given)
    if not judged:
        assert np.isnan([found["truth_lateral_4"][0], found["truth_lateral_8"][0]]).all()
        return
    assert found["truth_lateral_4"] == pytest.approx(12 / 13)
    assert (found["truth_lateral_8"], found["lateral_4"]) == (0.0, 0.0)
    assert np.isnan(values(paths(agents(1), known=2))["truth_lateral_4"][0])


def test_agents_jump_between_instants_and_from_the_past():
    before, now = paths(agents(2)), paths(agents(2, 0.2), error_m=1.5)
    found = values(PredictedPaths.joined([before, now]))
    np.testing.assert_allclose(found["jump"], [np.nan, np.nan, 1.5, 1.5])
    np.testing.assert_allclose(found["cycle_s"], [np.nan, np.nan, 0.2, 0.2])
    np.testing.assert_allclose(values(now, past=before)["jump"], [1.5, 1.5])
    mixture = paths(agents(1, 0.2), error_m=0.0, apart_m=4.0, weight=(0.75, 0.25))
    past = paths(agents(1), weight=(0.75, 0.25))
    assert values(mixture, past=past)["mixture_jump"] == pytest.approx(1.0)


def test_overlaps_are_looked_for_within_an_instant():
    side_by_side = paths(agents(2))
    assert values(side_by_side)["overlaps"].tolist() == [0.0, 0.0]
    side_by_side.mean[1, ..., 1] = 0.0
    assert values(side_by_side)["overlaps"].tolist() == [1.0, 1.0]
    apart = PredictedPaths.joined([paths(agents(1)), paths(agents(1, 0.2))])
    assert values(apart)["overlaps"].tolist() == [0.0, 0.0]
    assert H * DT == 5.0
