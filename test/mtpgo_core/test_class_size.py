# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sizes of road users whose size is not known."""

import numpy as np

from mtpgo_core.class_size import CLASS_SIZE_M, known_sizes
from mtpgo_core.schema import AgentClass


def test_unknown_sizes_are_those_of_the_class():
    size = np.array([[5.0, np.nan], [np.nan, np.nan]])
    kinds = np.array([AgentClass.CAR, AgentClass.PEDESTRIAN], np.uint8)
    expected = [[5.0, CLASS_SIZE_M[AgentClass.CAR][1]], CLASS_SIZE_M[AgentClass.PEDESTRIAN]]
    np.testing.assert_array_equal(known_sizes(size, kinds), expected)


def test_a_class_from_a_newer_publisher_is_unknown():
    found = known_sizes(np.full((1, 2), np.nan), np.array([200], np.uint8))
    np.testing.assert_array_equal(found, [CLASS_SIZE_M[AgentClass.UNKNOWN]])


def test_a_size_beyond_belief_is_that_of_the_class():
    found = known_sizes(np.array([[1e38, 2.0]]), np.array([AgentClass.CAR], np.uint8))
    np.testing.assert_array_equal(found, [[CLASS_SIZE_M[AgentClass.CAR][0], 2.0]])


def test_a_size_of_nothing_is_that_of_the_class():
    found = known_sizes(np.array([[0.0, -1.0]]), np.array([AgentClass.BUS], np.uint8))
    np.testing.assert_array_equal(found, [CLASS_SIZE_M[AgentClass.BUS]])
