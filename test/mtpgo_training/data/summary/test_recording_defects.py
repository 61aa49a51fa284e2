# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each kind of defect, put into good traffic at a known place."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.summary.recording_defects import KINDS, find_defects

TRACK = 1
"""Track into which a defect is put; its number is 101."""


def good():
    """Three cars for 6 s at 10 Hz, without a defect."""
    recording = braking_cars(tracks=3, seconds=6.0)
    return recording.select_rows(recording.frame >= 15)


def rows_of(recording):
    return np.flatnonzero(recording.track == TRACK)


def changed(**edits):
    """The good recording with columns edited by functions of (values, rows of the track)."""
    recording = good()
    values = {name: getattr(recording, name).copy() for name in edits}
    for name, edit in edits.items():
        edit(values[name], rows_of(recording))
    return dataclasses.replace(recording, **values)


def without(select):
    recording = good()
    rows = np.ones(len(recording), dtype=bool)
    rows[select(rows_of(recording))] = False
    return recording.select_rows(rows)


def shift(values, rows):
    values[rows[20]] += [3.0, 0.0]


def leap(values, rows):
    values[rows[20] :] += [0.0, 0.0]
    values[rows[20]] += [500.0, 0.0]


def turn(values, rows):
    values[rows] += np.pi


def mirror(values, rows):
    values[rows] *= -1.0


def placeholder(values, rows):
    values[rows[6]] = [-9999.0, 0.0]


def freeze(values, rows):
    values[rows[5]] = values[rows[4]]


def no_class(values, rows):
    values[TRACK] = AgentClass.UNKNOWN


def no_size(values, rows):
    values[TRACK] = np.nan


def sideways(values, rows):
    values[TRACK] = values[TRACK][::-1]


def in_milliseconds():
    """The good recording with times in milliseconds that were taken for seconds."""
    recording = good()
    return dataclasses.replace(recording, frame_rate=recording.frame_rate / 1000)


def at_odd_times(recording):
    frame = np.round(recording.frame * 100.0 + 7 * (recording.frame % 3)).astype(np.int64)
    return dataclasses.replace(recording, frame=frame, frame_rate=1000.0)


CASES = {
    "unit": (in_milliseconds, "recording 01: a row of a road user every 100 s, so that no"),
    "gap": (
        lambda: without(lambda rows: rows[10:17]),
        "recording 01, track 101, 0.90 s (frame 24): not observed for 0.80 s",
    ),
    "jump": (lambda: changed(position=shift), "track 101, 1.90 s (frame 34): 3.0 m off its cou"),
    "too fast": (lambda: changed(position=leap), "track 101, 1.90 s (frame 34): 50"),
    "rejected velocity": (
        lambda: changed(velocity=placeholder),
        "recording 01, track 101, 0.60 s (frame 21): 9999 m/s",
    ),
    "velocity": (lambda: changed(velocity=mirror), "track 101: in 100 % of its steps"),
    "heading": (lambda: changed(yaw=turn), "track 101: in 100 % of its steps"),
    "repeated position": (
        lambda: changed(position=freeze),
        "track 101, 0.40 s (frame 19): the velocity says ",
    ),
    "short track": (lambda: without(lambda rows: rows[8:]), "track 101: 0.70 s"),
    "empty time": (
        lambda: good().select_rows((good().frame < 25) | (good().frame > 44)),
        "recording 01, 0.90 s (frame 24): no road user for 2.10 s",
    ),
    "no rate": (lambda: at_odd_times(good()), "a row every 0.1"),
    "no class": (lambda: changed(agent_class=no_class), "recording 01, track 101"),
    "no size": (lambda: changed(size=no_size), "recording 01, track 101"),
    "size": (lambda: changed(size=sideways), "recording 01, track 101: 1.9 m long, 4.5 m wide"),
}


def test_good_traffic_has_no_defect():
    assert find_defects(good()) == []
    assert find_defects(good().select_rows(np.zeros(len(good()), dtype=bool))) == []


def test_every_kind_is_tested_here():
    assert set(CASES) | {"unreadable", "copy"} == set(KINDS)


@pytest.mark.parametrize("kind", CASES)
def test_a_defect_is_found_with_its_place(kind):
    make, text = CASES[kind]
    found = {item.kind: item for item in find_defects(make())}
    assert kind in found
    assert text in str(found[kind].first[0])
    if kind not in ("empty time",):
        assert found[kind].count <= 2
    others = set(found) - {kind}
    follow = {"too fast": {"jump"}, "empty time": {"gap"}, "unit": {"gap", "empty time"}}
    assert others <= follow.get(kind, set())


def test_what_the_history_does_not_bridge_is_a_gap_at_any_rate():
    recording = dataclasses.replace(good(), frame_rate=1.5)
    gaps = {item.kind: item.count for item in find_defects(recording)}["gap"]
    assert gaps == len(recording) - len(recording.track_id)
    assert "gap" not in {
        item.kind for item in find_defects(dataclasses.replace(good(), frame_rate=2.0))
    }


@pytest.mark.filterwarnings("error")
def test_numbers_whose_square_overflows_are_too_fast():
    def far(values, rows):
        values[rows[20]] = 1e300

    for name in ("position", "velocity"):
        kinds = {item.kind for item in find_defects(changed(**{name: far}))}
        far_off = {"too fast", "jump"} if name == "position" else {"rejected velocity"}
        assert kinds == far_off
