# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The EWTA loss by hand and against an obvious loop."""

import pytest
import torch

from mtpgo_training.training.losses.ewta_loss import ewta_loss, mean_distance


def slow_ewta(mean, target, mask, winners, delta):
    total = 0.0
    for b in range(mean.shape[0]):
        for n in range(mean.shape[1]):
            losses = []
            for m in range(mean.shape[2]):
                value = 0.0
                for h in range(mean.shape[3]):
                    for s in range(mean.shape[4]):
                        e = abs(float(mean[b, n, m, h, s] - target[b, n, h, s]))
                        huber = 0.5 * e * e if e <= delta else delta * (e - 0.5 * delta)
                        value += huber * float(mask[b, n, h])
                losses.append(value)
            total += sum(sorted(losses)[:winners]) / winners
    return total / float(mask.sum())


@pytest.mark.parametrize("winners", [1, 2, 4])
def test_ewta_equals_a_loop_over_everything(winners):
    draw = torch.Generator().manual_seed(0)
    mean = 2.0 * torch.randn(2, 3, 4, 5, 2, generator=draw)
    target = torch.randn(2, 3, 5, 2, generator=draw)
    mask = (torch.rand(2, 3, 5, generator=draw) < 0.7).float()
    value = ewta_loss(mean, target, mask, winners, huber_delta=0.8)
    assert float(value) == pytest.approx(slow_ewta(mean, target, mask, winners, 0.8), rel=1e-5)


def test_only_the_winners_receive_a_gradient():
    mean = torch.tensor([0.1, 3.0, -0.2, 5.0]).view(1, 1, 4, 1, 1).requires_grad_()
    ewta_loss(mean, torch.zeros(1, 1, 1, 1), torch.ones(1, 1, 1), 2).backward()
    assert (mean.grad.flatten() != 0).tolist() == [True, False, True, False]


def test_winners_are_chosen_over_the_observed_horizon_only():
    mean = torch.tensor([[0.0, 100.0], [1.0, 0.0]]).view(1, 1, 2, 2, 1).requires_grad_()
    mask = torch.tensor([1.0, 0.0]).view(1, 1, 2)
    ewta_loss(mean, torch.zeros(1, 1, 2, 1), mask, 1).backward()
    assert float(mean.grad.abs().sum()) == 0.0  # mode 0 is right at the only observed step


def test_nothing_observed_gives_zero_and_no_nan():
    mean = torch.randn(1, 2, 3, 4, 2, requires_grad=True)
    value = ewta_loss(mean, torch.zeros(1, 2, 4, 2), torch.zeros(1, 2, 4), 1)
    value.backward()
    assert float(value.detach()) == 0.0
    assert torch.isfinite(mean.grad).all()


def test_the_distance_counts_observed_steps_only():
    mean = torch.zeros(1, 1, 1, 3, 2)
    target = torch.tensor([[[[3.0, 4.0], [0.0, 1.0], [99.0, 0.0]]]])
    mask = torch.tensor([[[1.0, 0.5, 0.0]]])
    assert float(mean_distance(mean, target, mask)) == pytest.approx(3.0)
