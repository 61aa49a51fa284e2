# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty.mode_diversity import mode_distance, weight_near_heaviest

END = np.array([[[0.0, 0.0], [0.9, 0.0], [0.0, 4.0]]])


def test_the_distance_of_two_modes_drawn_by_weight():
    weight = np.array([[0.5, 0.0, 0.5]])
    assert mode_distance(END, weight) == pytest.approx(2 * 0.25 * 4.0)
    assert mode_distance(END, np.array([[1.0, 0.0, 0.0]])) == 0.0
    assert mode_distance(np.zeros((1, 3, 2)), np.full((1, 3), 1 / 3)) == 0.0


def test_weight_near_the_heaviest_counts_itself():
    assert weight_near_heaviest(END, np.array([[0.5, 0.3, 0.2]])) == pytest.approx(0.8)
    assert weight_near_heaviest(END, np.array([[0.3, 0.2, 0.5]])) == pytest.approx(0.5)
    assert weight_near_heaviest(END, np.array([[0.5, 0.3, 0.2]]), 5.0) == pytest.approx(1.0)
