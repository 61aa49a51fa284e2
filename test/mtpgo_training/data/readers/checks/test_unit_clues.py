# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in other units than they were read in, and those that only look a little like it."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_training.data.readers.checks.unit_clues import unit_clue

CARS = braking_cars(tracks=3, seconds=6.0)


def scaled(length=1.0, time=1.0):
    return dataclasses.replace(
        CARS, position=CARS.position * length, frame_rate=CARS.frame_rate / time
    )


@pytest.mark.parametrize(
    ("length", "time", "clue"),
    [
        (1, 1e3, "a row of a road user every 100 s, so that no movement can be followed; is the"),
        (1, 60, "a row of a road user every 6 s"),
        (1, 1e-3, "a row of a road user every 0.0001 s"),
        (1, 1 / 60, "m/s, so that the history rejects most rows; is the unit of the positions or"),
        (1e3, 1, "m/s, so that the history rejects most rows"),
        (1e-3, 1, "3 road users at a time are within 0.0"),
        (1e-5, 1, "is the unit of the positions another one, such as degrees or kilometres?"),
    ],
)
def test_another_unit_is_found(length, time, clue):
    assert clue in unit_clue(scaled(length, time))


@pytest.mark.filterwarnings("error")
def test_other_recordings_have_no_clue():
    one = CARS.select_rows(CARS.frame == CARS.frame[0])
    sparse = CARS.select_rows((CARS.track > 0) | (CARS.frame % 59 == 0))  # one lost for long
    still = dataclasses.replace(CARS, position=CARS.position[:1] + 3.0 * CARS.track[:, None])
    lost = CARS.position.copy()
    lost[5] = 1e7
    far = dataclasses.replace(CARS, position=lost)
    lost = lost.copy()
    lost[7], lost[8] = 1.7e308, [np.nan, -1.7e308]
    beyond = dataclasses.replace(CARS, position=lost)
    unknown = dataclasses.replace(CARS, position=np.full_like(lost, np.nan))
    none = CARS.select_rows(np.zeros(len(CARS), dtype=bool))
    found = [
        unit_clue(r)
        for r in (
            CARS,
            one,
            sparse,
            still,
            far,
            beyond,
            unknown,
            none,
            scaled(3.28),
            scaled(1, 5),
        )
    ]
    assert found == [""] * 10


def test_a_past_that_the_history_does_not_bridge_is_found():
    slow = CARS.select_rows(CARS.frame % round(CARS.frame_rate) == 0)
    assert "a row of a road user every 1 s, where the history bridges 0.5 s" in unit_clue(slow)
    every = np.arange(len(CARS))
    fresh = dataclasses.replace(
        CARS,
        track=every,
        track_id=every,
        agent_class=CARS.agent_class[CARS.track],
        size=CARS.size[CARS.track],
    )
    assert f"most of the {len(CARS)} road users have one row" in unit_clue(fresh)
