# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss schedule of Algorithm 1 by hand, and the learning rate at its limits."""

import itertools

import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.losses.schedules import learning_rate, loss_weights


def test_algorithm_1_with_32_epochs_and_8_modes():
    # V = 4, W = 8. K = ceil(8 (4 - n) / 4).
    assert [loss_weights(n, 32, 8).winners for n in range(4)] == [8, 6, 4, 2]
    assert all(loss_weights(n, 32, 8).nll == 0.0 for n in range(4))
    blend = [(loss_weights(n, 32, 8).ewta, loss_weights(n, 32, 8).nll) for n in range(4, 8)]
    assert blend == [(1.0, 0.0), (0.75, 0.25), (0.5, 0.5), (0.25, 0.75)]
    assert all(loss_weights(n, 32, 8).winners == 1 for n in range(4, 8))
    for n in (8, 20, 31):
        assert (loss_weights(n, 32, 8).ewta, loss_weights(n, 32, 8).nll) == (0.0, 1.0)


def test_the_number_of_winners_is_rounded_up():
    # V = 3: 8 * 3/3, 8 * 2/3 = 5.33, 8 * 1/3 = 2.67.
    assert [loss_weights(n, 24, 8).winners for n in range(3)] == [8, 6, 3]


def test_without_a_warm_up_it_is_the_likelihood_from_the_start():
    for n in (0, 1, 31):
        weights = loss_weights(n, 32, 8, warm_up_share=0.0)
        assert (weights.ewta, weights.nll) == (0.0, 1.0)


def test_a_longer_warm_up_is_twice_as_long_in_both_of_its_parts():
    assert [loss_weights(n, 16, 8, warm_up_share=0.5).winners for n in range(4)] == [8, 6, 4, 2]
    assert [loss_weights(n, 16, 8, warm_up_share=0.5).ewta for n in (4, 6, 8)] == [1.0, 0.5, 0.0]


def test_a_single_epoch_is_ewta_with_all_modes():
    assert loss_weights(0, 1, 8).winners == 8


def test_no_epochs_is_refused():
    with pytest.raises(ConfigurationError, match="0 epochs"):
        loss_weights(0, 0, 8)


def test_cosine_rises_then_falls_to_its_floor():
    rate = [learning_rate(s, s / 100, peak=1.0, warmup_steps=10, floor=0.1) for s in range(101)]
    assert rate[0] == pytest.approx(0.1)
    assert rate[9] == pytest.approx(1.0)
    assert rate[50] == pytest.approx(0.55)
    assert rate[100] == pytest.approx(0.1)
    assert all(b < a for a, b in itertools.pairwise(rate[10:]))


def test_constant_stays_after_the_rise():
    rate = [
        learning_rate(s, s / 9, peak=2.0, warmup_steps=2, schedule="constant") for s in range(9)
    ]
    assert rate == [1.0] + [2.0] * 8


def test_an_unknown_schedule_is_answered_with_the_known_ones():
    with pytest.raises(ConfigurationError, match="'cosine', 'constant'"):
        learning_rate(0, 0.0, peak=1.0, schedule="linear")
