# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of vehicles that cannot be, and those of ordinary traffic."""

import numpy as np
import pytest

from mtpgo_core.history.checks.box_fit import BoxFit
from mtpgo_core.schema import AgentClass

QUEUE = np.stack([5.5 * np.arange(10.0), np.zeros(10)], axis=1)
CARS = np.full(10, AgentClass.CAR)


def problems(position, size=(4.5, 1.8), agent_class=CARS, looks=10):
    fit = BoxFit()
    for _ in range(looks):
        fit.compare(position, np.broadcast_to(size, position.shape), agent_class)
    return fit.size_problem, fit.double_problem


def test_exchanged_sizes():
    wide, double = problems(QUEUE, (1.8, 4.5))
    assert "100 % of the vehicles are wider than long: are the two exchanged?" in wide
    assert double == ""


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_two_trackers_with_the_same_vehicles(share):
    again = QUEUE[: round(10 * share)] + np.array([0.4, -0.2])
    position = np.concatenate([QUEUE, again])
    double = problems(position, agent_class=np.full(len(position), AgentClass.VAN))[1]
    expected = 100 if share == 1.0 else 67
    assert f"{expected} % of the vehicles are within 1 m of another one" in double


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"size": (np.nan, np.nan)},
        {"size": (0.5, 0.6), "agent_class": np.full(10, AgentClass.PEDESTRIAN)},
        {"position": 0.05 * QUEUE, "agent_class": np.full(10, AgentClass.PEDESTRIAN)},
        {"position": 0.0 * QUEUE, "agent_class": np.full(10, AgentClass.UNKNOWN)},
        {"position": QUEUE[:1]},
        {"position": QUEUE[:0], "agent_class": CARS[:0]},
        {"size": (1.8, 4.5), "looks": 3},
    ],
)
def test_ordinary_traffic(settings):
    position = settings.pop("position", QUEUE)
    settings.setdefault("agent_class", CARS[: len(position)])
    assert problems(position, **settings) == ("", "")
