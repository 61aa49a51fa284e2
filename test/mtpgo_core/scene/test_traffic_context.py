# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Features of the surrounding agents, by hand-worked numbers and a simple loop."""

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.scene import neighbour_geometry as surroundings
from mtpgo_core.scene.leader_context import BAND_M
from mtpgo_core.scene.neighbour_geometry import NEAR_M
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.scene.traffic_context import LANE_M, USUAL_LENGTH_M, traffic_features
from mtpgo_core.task.task_description import CONTEXT_FEATURES, SceneConfig

REACH_M = 80.0
NAMES = CONTEXT_FEATURES["traffic"]
NO_AGENT = {"gap": REACH_M, "near": 0.0, "dv": 0.0, "ax": 0.0, "across": 0.0}


def named(row) -> dict[str, float]:
    return dict(zip(NAMES, row.tolist(), strict=True))


def test_a_northbound_queue_by_hand():
    # Heading north, so left is -x: two ahead, one behind, one on the left ahead, one on the right
    # behind, one beyond all bands.
    position = [[0, 0], [0.5, 20], [0, 40], [0, -15], [-3.7, 30], [3, -10], [9, 5]]
    velocity = [[0, 12], [0, 9], [0, 15], [0, 13], [0, 20], [0, 11], [0, 1]]
    acceleration = [[0, 0], [0, -2], [0, 1], [0, 9], [0, 9], [0, 9], [0, 9]]
    size = [[5, 2], [15, 2.5], [np.nan, np.nan], [4, 2], [4, 2], [4, 2], [4, 2]]
    window = window_of(
        np.array(position, dtype=float)[:, None],
        np.array(velocity, dtype=float)[:, None],
        np.full((7, 1), np.pi / 2),
        acceleration=np.array(acceleration, dtype=float)[:, None],
        size=size,
    )
    got = named(traffic_features(window, np.array([0]), REACH_M)[0, 0])
    expected = {name: NO_AGENT.get(name.split("_")[-1], 0.0) for name in NAMES}
    expected |= {"length": 5.0, "lead1_across": -0.5}
    for place, gap, dv in (
        ("lead1", 20 - 10.0, -3.0),
        ("lead2", 40 - 0.5 * (5 + USUAL_LENGTH_M), 3.0),
        ("behind", 15 - 4.5, 1.0),
        ("left_ahead", 30 - 4.5, 8.0),
        ("right_behind", 10 - 4.5, -1.0),
    ):
        expected |= {f"{place}_gap": gap, f"{place}_dv": dv}
        expected[f"{place}_near"] = np.exp(-gap / NEAR_M)
    expected |= {"lead1_ax": -2.0, "lead2_ax": 1.0}
    assert got == pytest.approx(expected, abs=1e-12)


def test_alone_and_of_unknown_size():
    window = window_of([[[0, 0]]], [[[3, 0]]], [[0]])
    got = named(traffic_features(window, np.array([0]), REACH_M)[0, 0])
    assert got["length"] == USUAL_LENGTH_M
    assert all(got[name] == NO_AGENT[name.split("_")[-1]] for name in NAMES[1:])


def nearest(found, many):
    """Return gap, near, dv, ax of the ``many`` nearest, neutral where there are fewer."""
    rows = [row[1:] for row in sorted(found)]
    return [*rows, *[(REACH_M, 0.0, 0.0, 0.0, 0.0)] * many][:many]


def test_many_random_agents_against_a_loop(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(surroundings, "_BLOCK", 100)  # several blocks
    rng = np.random.default_rng(4)
    n, steps = 40, 3
    size = np.stack([rng.uniform(3, 15, n), rng.uniform(1.5, 2.5, n)], axis=1)
    size[rng.random(n) < 0.2] = np.nan
    window = window_of(
        rng.uniform([-60, -8], [60, 8], (n, steps, 2)),
        rng.normal(0, 5, (n, steps, 2)),
        rng.normal(0, 0.3, (n, steps)),
        valid=rng.random((n, steps)) < 0.8,
        acceleration=rng.normal(0, 1, (n, steps, 2)),
        size=size,
    )
    got = traffic_features(window, np.arange(n), REACH_M)
    length = np.where(np.isnan(size[:, 0]), USUAL_LENGTH_M, size[:, 0])
    for i in range(n):
        for k in range(steps):
            if not window.valid[i, k]:
                continue
            ahead = np.array([np.cos(window.yaw[i, k]), np.sin(window.yaw[i, k])])
            left = np.array([-ahead[1], ahead[0]])
            places = {}
            for j in range(n):
                offset = window.position[j, k] - window.position[i, k]
                along, across = offset @ ahead, offset @ left
                if j == i or not abs(along) < REACH_M or not abs(across) < BAND_M + LANE_M:
                    continue
                band = "" if abs(across) < BAND_M else "left_" if across > 0 else "right_"
                gap = abs(along) - 0.5 * (length[i] + length[j])
                dv = (window.velocity[j, k] - window.velocity[i, k]) @ ahead
                ax = window.acceleration[j, k] @ ahead
                row = (abs(along), gap, np.exp(-max(gap, 0.0) / NEAR_M), dv, ax, across)
                places.setdefault(band + ("ahead" if along > 0 else "behind"), []).append(row)
            leads = nearest(places.get("ahead", []), 3)
            expected = [length[i], *(v for lead in leads for v in lead[:4]), leads[0][4]]
            for place in ("behind", "left_ahead", "left_behind", "right_ahead", "right_behind"):
                expected += nearest(places.get(place, []), 1)[0][:3]
            np.testing.assert_allclose(got[i, k], expected, atol=1e-9)


def test_far_from_the_origin_no_precision_is_lost():
    position = np.array([[[0.0, 0.0]], [[30.0, 1.9]], [[60.0, 1.0]], [[0.0, 3.0]]])
    arrays = (np.zeros((4, 1, 2)), np.zeros((4, 1)))
    near, far = (
        traffic_features(window_of(position + origin, *arrays), np.arange(4))
        for origin in ([0.0, 0.0], [691_000.0, 5_334_000.0])
    )
    np.testing.assert_allclose(near, far, atol=1e-8)
    assert near[0, 0, NAMES.index("lead2_gap")] == 60.0 - USUAL_LENGTH_M


def test_scenes_carry_the_columns():
    window = window_of(
        np.array([[[0.0, 0.0]], [[30.0, 0.0]]]), np.zeros((2, 1, 2)), np.full((2, 1), 0.0)
    )
    config = SceneConfig(context="traffic", leader_reach_m=25.0)
    batch = build_scenes(window, config, centres=np.array([0]))
    assert config.features[-len(NAMES) :] == NAMES
    assert batch.features[0, 0, -1, config.features.index("lead1_gap")] == 25.0
