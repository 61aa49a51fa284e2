# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The normal distribution function against the standard library's."""

import math

import numpy as np

from mtpgo_core.risk.normal_integral import normal_density, normal_integral


def test_it_is_the_distribution_function():
    x = np.concatenate([np.linspace(-7.0, 7.0, 4001), [-1e300, 1e300, -np.inf, np.inf]])
    wanted = [0.5 * math.erfc(-v / math.sqrt(2.0)) for v in x]
    np.testing.assert_allclose(normal_integral(x), wanted, rtol=0.0, atol=2e-9)


def test_nan_stays_nan_and_shapes_stay():
    found = normal_integral(np.array([[0.0, np.nan]]))
    assert found.shape == (1, 2)
    assert abs(found[0, 0] - 0.5) < 1e-12
    assert np.isnan(found[0, 1])


def test_density():
    np.testing.assert_allclose(normal_density(np.zeros(1)), 1.0 / math.sqrt(2.0 * math.pi))
