# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values that no tracker should send, over real DDS."""

import dataclasses

import numpy as np
import pytest
from fault_harness import OK, WARN


@pytest.fixture(scope="module")
def node(start_predictor):
    """The predictor of this module."""
    return start_predictor(use_tracker_covariance=True)


def spoilt(states, name, value, row=1):
    """Return the states with one value of one road user replaced."""
    array = getattr(states, name).copy()
    array[row] = value
    return dataclasses.replace(states, **{name: array})


OTHERS = (0, 2, 3)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39], ids=str)
def test_a_position_that_is_no_place(node, value):
    node.fresh().healthy()
    with node.counts(non_finite=1):
        # The road user is known: it is carried on from its last observation.
        node.predict(spoilt(node.states(), "position", value), *OTHERS)
    node.healthy()
    assert node.said("input", WARN, "without a finite position")
    assert OK  # levels end: the last test of this module
