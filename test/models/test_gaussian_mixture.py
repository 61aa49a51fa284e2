# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The likelihood against torch.distributions, and the local mean by hand."""

import math

import pytest
import torch
from torch.distributions import Categorical, MixtureSameFamily, MultivariateNormal

from models.gaussian_mixture import (
    favour_staying,
    gaussian_log_prob,
    heaviest_at_local_mean,
    mixture_nll,
    position_nll,
)

B, N, M, H = 2, 3, 4, 5


def make(size, dtype=torch.float64):
    root = torch.randn(B, N, M, H, size, size).double()
    covariance = root @ root.transpose(-1, -2) + 0.05 * torch.eye(size)
    log_weight = torch.randn(B, N, M).double().log_softmax(-1)
    mean, target = torch.randn(B, N, M, H, size).double(), torch.randn(B, N, H, size).double()
    return tuple(x.to(dtype) for x in (log_weight, mean, covariance, target))


def expected(log_weight, mean, covariance, target):
    components = MultivariateNormal(mean.transpose(2, 3), covariance.transpose(2, 3))
    weights = Categorical(logits=log_weight.unsqueeze(2).expand(-1, -1, H, -1))
    return -MixtureSameFamily(weights, components).log_prob(target)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_gaussian(size):
    _, mean, covariance, _ = make(size)
    target = torch.randn_like(mean)
    want = MultivariateNormal(mean, covariance).log_prob(target)
    torch.testing.assert_close(gaussian_log_prob(mean, covariance, target), want)


def test_gaussian_by_hand():
    """Density of a standard normal at its mean, and one deviation away in one of two axes."""
    at_mean = gaussian_log_prob(torch.zeros(2), torch.eye(2), torch.zeros(2))
    assert float(at_mean) == pytest.approx(-math.log(2 * math.pi))
    away = gaussian_log_prob(torch.zeros(2), 4.0 * torch.eye(2), torch.tensor([2.0, 0.0]))
    assert float(away) == pytest.approx(-math.log(2 * math.pi * 4.0) - 0.5)


@pytest.mark.parametrize("size", [2, 4])
def test_mixture(size):
    arguments = make(size)
    mask = torch.rand(B, N, H) > 0.3
    got = mixture_nll(*arguments, mask)
    torch.testing.assert_close(got[mask], expected(*arguments)[mask])
    assert not got[~mask].any()


def test_position_of_a_full_state():
    log_weight, mean, covariance, target = make(4)
    got = position_nll(log_weight, mean, covariance, target, torch.ones(B, N, H).bool())
    want = expected(log_weight, mean[..., :2], covariance[..., :2, :2], target[..., :2])
    torch.testing.assert_close(got, want)


def test_gradients():
    _, mean, covariance, target = make(4)
    mask = torch.rand(B, N, H) > 0.3
    leaves = [x.requires_grad_() for x in (torch.randn(B, N, M).double(), mean, covariance)]
    arguments = (leaves[0].log_softmax(-1), mean, covariance, target)
    ours = torch.autograd.grad(mixture_nll(*arguments, mask).sum(), leaves, retain_graph=True)
    theirs = torch.autograd.grad(expected(*arguments)[mask].sum(), leaves)
    for got, want in zip(ours[:2], theirs[:2], strict=True):
        torch.testing.assert_close(got, want)
    # Only the lower triangle is read here, and each library splits the derivative its own way.
    folded = [g.tril() + g.triu(1).transpose(-1, -2) for g in (ours[2], theirs[2])]
    torch.testing.assert_close(*folded)


def test_an_unknown_target_has_no_loss_and_no_gradient():
    log_weight, mean, covariance, target = make(4, torch.float32)
    leaves = [x.requires_grad_() for x in (log_weight, mean, covariance)]
    target[:, :, 2:] = float("nan")
    mask = torch.ones(B, N, H, dtype=torch.bool)
    mask[:, :, 2:] = False
    nll = mixture_nll(*leaves, target, mask)
    nll.sum().backward()
    assert not nll[:, :, 2:].any()
    for leaf in leaves:
        assert torch.isfinite(leaf.grad).all()


def test_far_from_all_modes_stays_finite():
    """A thousand deviations away every density underflows, but not its logarithm."""
    log_weight, mean, covariance, target = make(2, torch.float32)
    nll = mixture_nll(log_weight, mean, covariance, target + 1e3, torch.ones(B, N, H).bool())
    assert torch.isfinite(nll).all()
    assert (nll > 1e3).all()


def modes_ending_at(*ends, steps=2):
    """Return means [1, 1, M, steps, 2] from the origin to the ends, in equal steps."""
    end = torch.tensor(ends).double()
    part = torch.arange(1, steps + 1).double() / steps
    return (end[:, None] * part[:, None]).view(1, 1, len(ends), steps, 2)


def covariances(modes, *diagonal, steps=2):
    return torch.diag(torch.tensor(diagonal).double()).expand(1, 1, modes, steps, 2, 2)


def local_mean(weight, mean, covariance, share=1.0, kernel=1.0):
    log_weight = torch.tensor([[weight]], dtype=torch.float64).log()
    moving, kernels = (torch.tensor([[x]]).double() for x in (share, kernel))
    return heaviest_at_local_mean(log_weight, mean, covariance, moving, kernels)


def test_the_heaviest_mode_moves_to_the_mean_of_those_around_it():
    """The second is heaviest; the first ends 2 deviations of 3 m ahead: its weight is
    0.4 exp(-2) = 0.0541 against 0.5, so the end moves by 6 m * 0.0977; the third is far away."""
    mean = modes_ending_at([16.0, 0.0], [10.0, 0.0], [10.0, 300.0])
    moved = local_mean([0.4, 0.5, 0.1], mean, covariances(3, 9.0, 1.0))
    near = 0.4 * math.exp(-2.0)
    end = 10.0 + 6.0 * near / (near + 0.5)
    torch.testing.assert_close(moved[0, 0, 1], torch.tensor([[end / 2, 0.0], [end, 0.0]]).double())
    torch.testing.assert_close(moved[0, 0, [0, 2]], mean[0, 0, [0, 2]], rtol=0.0, atol=0.0)


def test_a_wider_kernel_sees_more_modes():
    """With a kernel of 2 the mode 2 deviations away counts exp(-1/2)."""
    mean = modes_ending_at([0.0, 4.0], [0.0, 0.0])
    moved = local_mean([0.4, 0.6], mean, covariances(2, 1.0, 4.0), kernel=2.0)
    near = 0.4 * math.exp(-0.5)
    assert moved[0, 0, 1, -1, 1].item() == pytest.approx(4.0 * near / (near + 0.6), rel=1e-12)


def test_distances_follow_a_correlated_covariance():
    """Along the diagonal the deviation is sqrt(1.9), across it sqrt(0.1)."""
    mean = modes_ending_at([0.0, 0.0], [1.0, 1.0])
    spread = torch.tensor([[1.0, 0.9], [0.9, 1.0]], dtype=torch.float64).expand(1, 1, 2, 2, 2, 2)
    moved = local_mean([0.6, 0.4], mean, spread)
    near = 0.4 * math.exp(-0.5 * 2.0 / 1.9)
    assert moved[0, 0, 0, -1].tolist() == pytest.approx([near / (near + 0.6)] * 2, rel=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_the_share_says_how_far_it_moves(share):
    mean = modes_ending_at([16.0, 0.0], [10.0, 0.0])
    given = ([0.4, 0.6], mean, covariances(2, 9.0, 1.0))
    whole = local_mean(*given)
    torch.testing.assert_close(local_mean(*given, share), mean + share * (whole - mean))


def test_without_a_kernel_nothing_moves():
    mean = modes_ending_at([16.0, 0.0], [10.0, 0.0])
    moved = local_mean([0.4, 0.6], mean, covariances(2, 9.0, 1.0), kernel=0.0)
    torch.testing.assert_close(moved, mean, rtol=0.0, atol=0.0)


def test_all_states_of_a_path_move_alike():
    mean = torch.cat((modes_ending_at([2.0, 0.0], [0.0, 0.0]),) * 2, dim=-1)
    moved = local_mean([0.4, 0.6], mean, covariances(2, 1.0, 1.0))
    torch.testing.assert_close(moved[..., 2:], moved[..., :2])


def staying(share, bias=0.6):
    """Return the weights of 0.2 for a mode that stays, 0.2 for one 0.5 m on and 0.6 for 9 m."""
    place = torch.tensor([[[3.0, -4.0]]], dtype=torch.float64)
    mean = modes_ending_at([0.0, 0.0], [0.3, 0.4], [9.0, 0.0]) + place[:, :, None, None]
    log_weight = torch.tensor([[[0.2, 0.2, 0.6]]], dtype=torch.float64).log()
    moving = torch.tensor([[share]], dtype=torch.float64)
    return favour_staying(log_weight, mean, place, moving, bias).exp().flatten().tolist()


def test_a_mode_that_stays_becomes_likelier():
    stays, near = 0.2 * math.exp(0.6), 0.2 * math.exp(0.6 * math.exp(-0.5))
    total = stays + near + 0.6
    assert staying(0.0) == pytest.approx([stays / total, near / total, 0.6 / total], rel=1e-7)


def test_the_bias_vanishes_as_agents_move():
    half = 0.2 * math.exp(0.3)
    total = half + 0.2 * math.exp(0.3 * math.exp(-0.5)) + 0.6
    assert staying(0.5)[0] == pytest.approx(half / total, rel=1e-7)
    assert staying(1.0) == pytest.approx([0.2, 0.2, 0.6], rel=1e-12)
