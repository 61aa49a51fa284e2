# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The Huber losses that are added to an objective, by hand."""

import pytest
import torch

from mtpgo_training.training.losses.huber_terms import (
    HuberTerms,
    expected_huber_loss,
    heaviest_huber_loss,
)


def test_the_expected_huber_loss_is_weighted_by_the_mixture_and_trains_the_weights():
    mean = torch.tensor([0.5, 3.0]).view(1, 1, 2, 1, 1)
    logits = torch.zeros(1, 1, 2, requires_grad=True)
    log_weight = torch.log_softmax(logits, dim=-1)
    value = expected_huber_loss(log_weight, mean, torch.zeros(1, 1, 1, 1), torch.ones(1, 1, 1))
    assert float(value.detach()) == pytest.approx(0.5 * 0.125 + 0.5 * 2.5)
    value.backward()
    gradient = logits.grad.flatten()
    assert gradient[0] < 0.0 < gradient[1]  # towards the nearer component


def test_the_huber_loss_of_the_heaviest_mode_pulls_no_other_mode():
    """Of two modes of four steps the heavier one is 3 m off, the other 0: loss 2.5 a step."""
    log_weight = torch.tensor([0.4, 0.6]).log().view(1, 1, 2).requires_grad_()
    mean = torch.zeros(1, 1, 2, 4, 2)
    mean[0, 0, 1, :, 0] = 3.0
    mean.requires_grad_()
    loss = heaviest_huber_loss(log_weight, mean, torch.zeros(1, 1, 4, 2), torch.ones(1, 1, 4))
    assert float(loss.detach()) == pytest.approx(2.5)
    loss.backward()
    assert mean.grad[0, 0, 1, :, 0].all()
    assert not mean.grad[0, 0, 0].any()
    assert log_weight.grad is None


def test_the_terms_are_added_by_their_weights():
    """Losses 0.125 and 2.5 of two modes with weights 0.25 and 0.75: expected 1.90625."""
    mean = torch.tensor([0.5, 3.0]).view(1, 1, 2, 1, 1)
    log_weight = torch.tensor([0.25, 0.75]).log().view(1, 1, 2)
    given = log_weight, mean, torch.zeros(1, 1, 1, 1), torch.ones(1, 1, 1)
    for mean_weight, heaviest_weight, expected in ((0, 0, 0), (2, 0, 3.8125), (1, 4, 11.90625)):
        value = HuberTerms(1.0, mean_weight, heaviest_weight)(*given)
        assert float(value) == pytest.approx(expected)
