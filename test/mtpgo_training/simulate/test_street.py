# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated street: reproducible, with a limit on its lanes."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_traffic import needs_sumo

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.simulate.street import StreetConfig, simulate_street


@needs_sumo
def test_the_same_seed_gives_the_same_recording() -> None:
    config = StreetConfig(seconds=5.0, seed=2, warm_up_s=20.0)
    np.testing.assert_array_equal(
        simulate_street(config).position, simulate_street(config).position
    )


def test_four_lanes_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="lanes is 4, expected 1 to 3"):
        StreetConfig(lanes=4)
