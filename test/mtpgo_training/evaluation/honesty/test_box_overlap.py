# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Overlaps of boxes and of predicted paths."""

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty.box_overlap import (
    boxes_overlap,
    new_overlaps,
    pairs_within,
    path_headings,
)

H = 5
CAR = np.array([[4.0, 2.0]])


def overlap(offset, yaw, size=CAR):
    """Whether a car at the origin that heads to +x meets one at an offset with a yaw."""
    heading = np.array([[np.cos(yaw), np.sin(yaw)]])
    position = (np.zeros((1, 2)), np.array([offset], dtype=float))
    return bool(boxes_overlap(position, (np.array([[1.0, 0.0]]), heading), (CAR, size))[0])


@pytest.mark.parametrize(
    ("offset", "yaw", "expected"),
    [
        ((3.9, 0.0), 0.0, True),
        ((4.1, 0.0), 0.0, False),
        ((0.0, 1.9), 0.0, True),
        ((0.0, 2.1), 0.0, False),
        ((2.9, 0.0), np.pi / 2, True),
        ((3.1, 0.0), np.pi / 2, False),
        # Turned by 45 degrees, the corner is at 3 / sqrt(2) = 2.12 from the centre.
        ((4.1, 0.0), np.pi / 4, True),
        ((4.2, 0.0), np.pi / 4, False),
        # Bounding boxes meet, the boxes do not.
        ((3.8, 2.8), -np.pi / 4, False),
    ],
)
def test_boxes_meet_unless_an_axis_separates_them(offset, yaw, expected):
    assert overlap(offset, yaw) is expected


def test_a_heading_is_kept_through_standing():
    path = np.array([[[0.0, 0.0], [0.0, 1.0], [0.01, 1.0], [-1.0, 1.0]]])
    found = path_headings(path, np.zeros((1, 2)), np.array([np.pi]))
    expected = [[-1, 0], [0, 1], [0, 1], [-1, 0]]
    np.testing.assert_allclose(found[0], expected, atol=1e-9)


def test_pairs_are_those_of_an_instant():
    first, second = pairs_within(np.array([5, 5, 5, 8, 9, 9]))
    assert sorted(zip(first.tolist(), second.tolist(), strict=True)) == [
        (0, 1),
        (0, 2),
        (1, 2),
        (4, 5),
    ]
    assert pairs_within(np.empty(0, np.int64))[0].shape == (0,)


def found(predicted, truth, mask=None, start=None):
    """New overlaps of agents of one instant with positions along x [n, H] (m)."""
    n = len(predicted)
    path, real = (
        np.stack([x, np.zeros((n, H))], axis=-1) for x in map(np.array, (predicted, truth))
    )
    begin = path[:, 0] if start is None else np.stack([start, np.zeros(n)], axis=-1)
    return new_overlaps(
        path.astype(float),
        real.astype(float),
        np.ones((n, H), bool) if mask is None else np.array(mask),
        begin,
        np.zeros(n),
        np.tile(CAR, (n, 1)),
        pairs_within(np.zeros(n, np.int64)),
    ).tolist()


STILL, FAR = [0.0] * H, [100.0] * H
RUNS_INTO = [20.0, 15.0, 10.0, 5.0, 2.0]
STOPS = [20.0, 15.0, 10.0, 10.0, 10.0]


def test_only_predicted_overlaps_that_did_not_happen_count():
    assert found([STILL, RUNS_INTO, FAR], [STILL, STOPS, FAR]) == [True, True, False]
    assert found([STILL, RUNS_INTO, FAR], [STILL, RUNS_INTO, FAR]) == [False] * 3
    assert found([STILL, STOPS, FAR], [STILL, RUNS_INTO, FAR]) == [False] * 3


def test_steps_that_were_not_observed_do_not_count():
    mask = np.ones((2, H), bool)
    mask[1, -1] = False
    assert found([STILL, RUNS_INTO], [STILL, STOPS], mask) == [False, False]


def test_others_that_come_from_afar_are_considered():
    assert found([STILL, RUNS_INTO], [STILL, STOPS], start=[0.0, 25.0]) == [True, True]
