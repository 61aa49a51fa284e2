# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recording that was played into a bag, and the offset of the bag's clock."""

import dataclasses

import numpy as np
import pytest
from recorded_bags import play
from traffic import braking_cars

from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags, observed_recordings
from mtpgo_training.evaluation.bags.clock_alignment import AlignedPart, find_parts


def test_a_bags_observations_determine_its_clock_offset(recording, runner, tmp_path):
    shift_ns = 3_040_000_000
    late = recording.between(2.0, None)  # the bag begins in the middle, on another clock
    bag = play(late, runner, tmp_path / "late", shift_ns=shift_ns, every=5)
    other = dataclasses.replace(
        braking_cars("02", tracks=8, seconds=8.0, seed=4), start_time_ns=recording.start_time_ns
    )
    (part,) = find_parts(list(observed_recordings([bag]).values()), {"02": other, "01": recording})
    assert (part.name, part.shift_ns) == ("01", shift_ns)
    result = evaluate_bags([bag], {"02": other, "01": recording}, {})
    assert list(result.evaluation.recordings) == ["01"]
    assert not result.warnings
    own = evaluate_bags([bag], observed_recordings([bag]), {}, own_clock=False)
    assert _scores(result)["ade"] == pytest.approx(_scores(own)["ade"], abs=1e-6)


def _scores(result):
    return result.evaluation.scores.averages()["late"]["all"]


def test_two_recordings_played_one_after_the_other_have_their_own_offsets():
    one, two = braking_cars("01", tracks=4), braking_cars("02", tracks=4, seed=1)
    first, second = 5_000_000_000, 60_000_000_000
    played = [
        dataclasses.replace(recording, start_time_ns=recording.start_time_ns + shift_ns)
        for recording, shift_ns in ((two, first), (one, second))
    ]
    parts = find_parts(played, {"01": one, "02": two})
    assert [(part.name, part.shift_ns) for part in parts] == [("02", first), ("01", second)]
    end_ns = two.stamp_ns(int(two.frames[-1])) + first
    assert (parts[0].first_ns, parts[0].last_ns) == (two.start_time_ns + first, end_ns)


def test_positions_may_differ_by_five_centimetres():
    recording = braking_cars(tracks=4)
    for offset_m, name in ((0.04, "01"), (0.06, None)):
        moved = dataclasses.replace(
            recording, position=recording.position + np.array([0.0, offset_m])
        )
        (part,) = find_parts([moved], {"01": recording})
        assert (part.name, part.shift_ns) == (name, 0)


def test_road_users_at_rest_do_not_determine_the_offset():
    recording = braking_cars(tracks=4)
    still = dataclasses.replace(recording, velocity=np.zeros_like(recording.velocity))
    late = dataclasses.replace(still, start_time_ns=still.start_time_ns + 10**9)
    (part,) = find_parts([late], {"01": recording})
    assert (part.name, part.shift_ns) == (None, 0)


def test_a_part_holds_the_instants_between_its_observations():
    part = AlignedPart("01", 0, 10_000_000, 20_000_000)
    held = [part.holds(ms * 1_000_000) for ms in (8, 9, 10, 15, 20, 21, 22)]
    assert held == [False, True, True, True, True, True, False]
