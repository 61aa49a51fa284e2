# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The likelihood against torch's distributions, and the expected Huber loss by hand."""

import pytest
import torch

from mtpgo_training.training.losses.likelihood_loss import (
    expected_huber_loss,
    negative_log_likelihood,
)


def test_nll_is_the_weighted_mean_of_a_mixture_of_distributions():
    draw = torch.Generator().manual_seed(1)
    mean = torch.randn(2, 3, 4, 5, 4, generator=draw)
    root = torch.randn(2, 3, 4, 5, 4, 4, generator=draw)
    covariance = root @ root.mT + 0.5 * torch.eye(4)
    target = torch.randn(2, 3, 5, 4, generator=draw)
    log_weight = torch.log_softmax(torch.randn(2, 3, 4, generator=draw), dim=-1)
    mask = torch.tensor([0.0, 0.3, 1.0, 1.0, 1.0]).expand(2, 3, 5)
    log = torch.distributions.MultivariateNormal(mean, covariance).log_prob(target.unsqueeze(2))
    each = -torch.logsumexp(log + log_weight.unsqueeze(-1), dim=2)
    expected = float((each * mask).sum() / mask.sum())
    value = negative_log_likelihood(log_weight, mean, covariance, target, mask)
    assert float(value) == pytest.approx(expected, rel=1e-4)


def test_the_expected_huber_loss_is_weighted_by_the_mixture_and_trains_the_weights():
    mean = torch.tensor([0.5, 3.0]).view(1, 1, 2, 1, 1)
    logits = torch.zeros(1, 1, 2, requires_grad=True)
    log_weight = torch.log_softmax(logits, dim=-1)
    value = expected_huber_loss(log_weight, mean, torch.zeros(1, 1, 1, 1), torch.ones(1, 1, 1))
    assert float(value.detach()) == pytest.approx(0.5 * 0.125 + 0.5 * 2.5)
    value.backward()
    gradient = logits.grad.flatten()
    assert gradient[0] < 0.0 < gradient[1]  # towards the nearer component
