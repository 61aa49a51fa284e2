# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicle types and departures, drawn with known shares and gaps."""

from __future__ import annotations

import numpy as np
import pytest

from mtpgo_training.simulate.drivers import departures, draw_types
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.sumo import EXTRA_S


def test_the_probabilities_of_a_labels_types_add_up_to_its_share() -> None:
    shares = {"car": 6.0, "truck": 3.0, "van": 0.0, "bicycle": 1.0}
    types, probability = draw_types(np.random.default_rng(0), shares, 5, desired_spread=0.1)
    assert len(types) == len({kind.name for kind in types}) == 15
    assert probability.sum() == pytest.approx(1.0)
    for label, share in (("car", 0.6), ("truck", 0.3), ("bicycle", 0.1)):
        own = [p for kind, p in zip(types, probability, strict=True) if kind.label == label]
        assert own == pytest.approx([share / 5] * 5)
    assert "van" not in {kind.label for kind in types}


def test_desired_speeds_have_the_given_spread_within_limits() -> None:
    def desired(spread: float) -> list[float]:
        types, _ = draw_types(np.random.default_rng(1), {"car": 1.0}, 400, desired_spread=spread)
        return [float(kind.attributes["speedFactor"]) for kind in types]

    assert desired(0.0) == [1.0] * 400
    assert np.std(desired(0.08)) == pytest.approx(0.08, rel=0.1)
    wide = desired(1.0)
    assert (min(wide), max(wide)) == (0.72, 1.4)


def test_a_truck_does_not_change_lanes_for_speed_as_eagerly_as_a_car() -> None:
    types, _ = draw_types(
        np.random.default_rng(2), {"car": 0.5, "truck": 0.5}, 200, desired_spread=0.0
    )
    eager = {
        label: [float(t.attributes["lcSpeedGain"]) for t in types if t.label == label]
        for label in ("car", "truck")
    }
    assert max(eager["truck"]) <= 0.8
    assert max(eager["car"]) > 2.0


def test_departures_have_the_demand_and_end_with_the_simulation() -> None:
    config = SimulationConfig(seconds=7200.0, warm_up_s=100.0)
    generator = np.random.default_rng(3)
    types, probability = draw_types(generator, {"car": 0.8, "truck": 0.2}, 2, desired_spread=0.0)
    found = list(departures(config, generator, 1200.0, types, probability))
    assert [departure.number for departure in found] == list(range(len(found)))
    times = np.array([departure.time_s for departure in found])
    assert times[0] == 0.0
    assert times[-1] < 7300.0 + EXTRA_S
    gaps = np.diff(times)
    # 1200 vehicles/h are 3 s apart; of an exponential distribution mean and spread are equal.
    assert gaps.mean() == pytest.approx(3.0, rel=0.1)
    assert gaps.std() == pytest.approx(3.0, rel=0.1)
    share = np.mean([departure.kind.label == "truck" for departure in found])
    assert share == pytest.approx(0.2, abs=0.03)
