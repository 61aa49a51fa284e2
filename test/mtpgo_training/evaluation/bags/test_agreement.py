# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Differences between recorded and offline predictions, worked by hand."""

import dataclasses

import numpy as np
import pytest
from demo_traffic import make_recording, perfect_prediction
from recorded_bags import play

from mtpgo_core.schema import Source
from mtpgo_training.evaluation.bags.agreement import Agreement
from mtpgo_training.evaluation.bags.bag_evaluation import evaluate_bags


def test_an_offset_of_centimetres_is_detected(bag, recording, runner):
    moved = dataclasses.replace(recording, position=recording.position + np.array([0.03, 0.0]))
    agreement = evaluate_bags([bag], {"01": moved}, {"default": runner}).agreements["online"]
    assert max(agreement["default"].differences_m) == pytest.approx(0.03, abs=2e-3)


@pytest.mark.parametrize("offset_m", [15_000.0, 600_000.0])
def test_messages_are_as_exact_as_the_network_at_any_coordinates(
    recording, runner, tmp_path, offset_m
):
    moved = dataclasses.replace(recording, position=recording.position + np.array([offset_m, 0.0]))
    bag = play(moved.between(0.0, 3.0), runner, tmp_path / "bag", every=10)
    found = evaluate_bags([bag], {"01": moved}, {"default": runner}).agreements["bag"]
    # 0.03 mm of the network's single precision, in modes that are moved up to three times as far.
    assert max(found["default"].differences_m) < 2e-4


@pytest.fixture
def made():
    """A recording, and the prediction of its two road users 7 and 8 at 2 s."""
    recording = make_recording()
    return recording, perfect_prediction(recording, 20)


def moved(prediction, agent, mode, step, by):
    """Return the prediction with one mean moved by [2] metres."""
    mean = prediction.mean.copy()
    mean[agent, mode, step, :2] += by
    return dataclasses.replace(prediction, mean=mean)


def test_the_largest_difference_over_modes_and_steps_counts(made):
    recording, own = made
    agreement = Agreement()
    recorded = moved(moved(own, 1, 0, 3, (0.0, 0.002)), 1, 1, 7, (0.003, 0.004))
    agreement.add(recorded, own, recording, "made")
    assert agreement.differences_m == pytest.approx([0.0, 0.005], abs=1e-12)
    assert agreement.where == "road user 8 of made at 2.0 s"
    assert agreement.text("bag", "model") == (
        "bag and model, agent by agent: the means of 2 predictions differ by 5.000 mm at most "
        "(road user 8 of made at 2.0 s), median 2.500 mm"
    )


def test_modes_of_equal_weight_may_be_in_another_order(made):
    recording, own = made
    for weights, difference_m in (([0.5, 0.5], 0.0), ([0.75, 0.25], 1.0)):
        first = dataclasses.replace(own, weight=np.tile(weights, (2, 1)))
        second = dataclasses.replace(first, mean=first.mean[:, ::-1])
        agreement = Agreement()
        agreement.add(first, second, recording, "made")
        assert agreement.differences_m == pytest.approx([difference_m] * 2, abs=1e-12)


def test_agents_that_only_one_of_the_two_predicts_are_counted(made):
    recording, own = made
    agreement = Agreement()
    served = np.array([Source.CONSTANT_VELOCITY, Source.MODEL], dtype=np.uint8)
    agreement.add(own, dataclasses.replace(own, source=served), recording, "made")
    other = dataclasses.replace(own, key=own.key[::-1].copy())
    other.key[0, 0] = 99  # road user 8 of the recorded prediction is not in the other
    agreement.add(own, other, recording, "made")
    assert (len(agreement.differences_m), agreement.unpaired) == (2, 2)
    assert agreement.text("bag", "model").endswith("; 2 not in both")


def test_nothing_to_compare_has_no_largest_difference():
    agreement = Agreement()
    assert agreement.to_dict()["largest_mm"] is None
    assert agreement.text("bag", "model").startswith("bag and model: nothing to compare")
