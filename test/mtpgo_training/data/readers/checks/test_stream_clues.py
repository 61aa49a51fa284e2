# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that as a whole cannot be what they should, and ordinary ones."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.readers.checks.stream_clues import stream_clues
from mtpgo_training.data.writers.ind_writer import write_ind

CARS = braking_cars(tracks=3, seconds=12.0)


def changed(**values):
    return dataclasses.replace(CARS, **values)


def test_another_unit_is_found():
    (clue,) = stream_clues(changed(velocity=CARS.velocity * 3.6))
    assert "velocities of the road users do not fit their movement in 9" in clue
    assert "3.6 times as large" in clue
    (clue,) = stream_clues(changed(yaw=CARS.yaw + np.pi / 2))
    assert "headings of the road users do not fit" in clue
    assert "turned by 90 degrees" in clue


def test_boxes_that_cannot_be_are_found():
    (clue,) = stream_clues(changed(size=CARS.size[:, ::-1]))
    assert clue == "100 % of the vehicles are wider than long: are the two exchanged?"
    beside = np.zeros_like(CARS.position)
    beside[CARS.track == 2] = (CARS.position[CARS.track == 1] + 0.3) - CARS.position[
        CARS.track == 2
    ]
    (clue,) = stream_clues(changed(position=CARS.position + beside))
    assert "of the vehicles are within 1 m of another one" in clue


@pytest.mark.filterwarnings("error")
def test_other_recordings_have_no_clue():
    nothing = np.full_like(CARS.position, np.nan)
    far = CARS.position.copy()
    far[::7] = 1.7e308
    some = CARS.velocity.copy()
    some[::5] = np.nan
    for recording in (
        CARS,
        changed(velocity=nothing, yaw=np.full(len(CARS), np.nan)),
        changed(velocity=some),
        changed(position=far),
        changed(position=nothing),
        CARS.select_rows(CARS.frame == CARS.frame[0]),
        CARS.select_rows(np.zeros(len(CARS), dtype=bool)),
        CARS.select_rows(np.arange(len(CARS)) % 11 < 2),
    ):
        assert stream_clues(recording) == []


def test_a_clue_is_said_where_recordings_are_read(tmp_path, caplog):
    write_ind(changed(velocity=CARS.velocity * 3.6), tmp_path)
    assert len(list(read_sources([DataSource(tmp_path, "ind")]))) == 1
    assert "3.6 times as large in the mean" in caplog.text
