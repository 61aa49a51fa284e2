# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The likelihoods against torch's distributions and by hand."""

import math

import pytest
import torch

from mtpgo_training.training.losses.likelihood_loss import (
    mode_likelihood_loss,
    negative_log_likelihood,
    trajectory_likelihood_loss,
)


def random_mixture(modes=3, steps=4, states=2, seed=1):
    """Log weights, means, covariances and targets of 2 scenes of 2 agents, in float64."""
    draw = torch.Generator().manual_seed(seed)
    size = (2, 2, modes, steps, states)
    mean = torch.randn(*size, generator=draw).double()
    root = torch.randn(*size, states, generator=draw).double()
    covariance = root @ root.mT + 0.5 * torch.eye(states)
    logits = torch.randn(2, 2, modes, generator=draw).double()
    target = torch.randn(2, 2, steps, states, generator=draw).double()
    return torch.log_softmax(logits, dim=-1), mean, covariance, target


def of_agent(mixture, b, n, steps=4):
    """The first steps of one agent alone."""
    log_weight, mean, covariance, target = (x[b : b + 1, n : n + 1] for x in mixture)
    return log_weight, mean[..., :steps, :], covariance[..., :steps, :, :], target[..., :steps, :]


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


@pytest.mark.parametrize("correlated_steps", [1.0, 2.0])
def test_the_likelihood_of_a_trajectory_is_the_sum_over_modes_by_hand(correlated_steps):
    """One agent, one coordinate of variance 4, two modes, three steps; the target stays at 0.

    The errors of the modes are 0, 0, 2 and 2, 2, 2: with d = -log(2 sqrt(2 pi)) a step, the log
    densities of the trajectories are 3 d - 0.5 and 3 d - 1.5.
    """
    mean = torch.tensor([[0.0, 0.0, 2.0], [2.0, -2.0, 2.0]]).view(1, 1, 2, 3, 1)
    covariance = torch.full((1, 1, 2, 3, 1, 1), 4.0)
    log_weight = torch.tensor([0.25, 0.75]).log().view(1, 1, 2)
    target, mask = torch.zeros(1, 1, 3, 1), torch.ones(1, 1, 3)
    density = 3.0 * -math.log(2.0 * math.sqrt(2.0 * math.pi))
    of_modes = [math.exp((density - error) / correlated_steps) for error in (0.5, 1.5)]
    together = 0.25 * of_modes[0] + 0.75 * of_modes[1]
    expected = -correlated_steps * math.log(together) / 3.0
    value = trajectory_likelihood_loss(
        log_weight, mean, covariance, target, mask, correlated_steps
    )
    assert float(value) == pytest.approx(expected, rel=1e-5)


def test_one_mode_has_to_explain_the_whole_trajectory():
    """Two modes that serve one step each are good for the steps and bad for the path."""
    mean = torch.tensor([[0.0, 5.0], [5.0, 0.0]]).view(1, 1, 2, 2, 1)
    covariance = torch.full((1, 1, 2, 2, 1, 1), 0.25)
    log_weight = torch.tensor([0.5, 0.5]).log().view(1, 1, 2)
    given = log_weight, mean, covariance, torch.zeros(1, 1, 2, 1), torch.ones(1, 1, 2)
    assert float(negative_log_likelihood(*given)) < 1.0
    assert float(trajectory_likelihood_loss(*given)) > 20.0


def test_of_a_single_step_both_likelihoods_are_the_same():
    given = random_mixture(steps=1)
    mask = torch.ones(2, 2, 1).double()
    torch.testing.assert_close(
        trajectory_likelihood_loss(*given, mask, 1.0), negative_log_likelihood(*given, mask)
    )


def test_correlated_steps_share_the_responsibility_and_nothing_else():
    """A single mode has it all: its likelihood does not depend on them."""
    mask = torch.ones(2, 2, 4).double()
    one, several = random_mixture(modes=1), random_mixture(modes=3)
    values = [trajectory_likelihood_loss(*one, mask, steps) for steps in (1.0, 3.0, 25.0)]
    for value in values:
        torch.testing.assert_close(value, negative_log_likelihood(*one, mask))
    given = [trajectory_likelihood_loss(*several, mask, steps) for steps in (1.0, 4.0)]
    assert abs(float(given[0] - given[1])) > 0.01


def responsibilities(correlated_steps):
    """Those of two modes, at the target and 1 m from it, from the gradient of the weights."""
    mean = torch.tensor([0.0, 1.0]).view(1, 1, 2, 1, 1).expand(1, 1, 2, 25, 1)
    covariance = torch.ones(1, 1, 2, 25, 1, 1)
    log_weight = torch.tensor([[[0.5, 0.5]]]).log().requires_grad_()
    zeros, ones = torch.zeros(1, 1, 25, 1), torch.ones(1, 1, 25)
    trajectory_likelihood_loss(
        log_weight, mean, covariance, zeros, ones, correlated_steps
    ).backward()
    return (-25.0 / correlated_steps * log_weight.grad).flatten().tolist()


def test_with_independent_steps_the_nearest_mode_takes_all_of_the_responsibility():
    """exp(-12.5) against 1; with 5 steps as one, exp(-2.5) against 1."""
    assert responsibilities(1.0)[1] == pytest.approx(math.exp(-12.5), rel=0.01)
    assert responsibilities(5.0)[1] == pytest.approx(1.0 / (1.0 + math.exp(2.5)), rel=1e-4)


def test_steps_without_a_target_do_not_count():
    log_weight, mean, covariance, target = random_mixture()
    mask = torch.ones(2, 2, 4).double()
    mask[0, 1, 2:] = 0.0
    mask[1, 0] = 0.0
    values = []
    for filling in (0.0, 1e9, float("nan")):
        filled = torch.where(mask.unsqueeze(-1) > 0.0, target, filling)
        parts = [x.clone().requires_grad_() for x in (log_weight, mean, covariance)]
        loss = trajectory_likelihood_loss(*parts, filled, mask, 2.0)
        loss.backward()
        values.append(loss.detach())
        for part in parts:
            assert torch.isfinite(part.grad).all()
            assert not part.grad[1, 0].any()
        assert not parts[1].grad[0, 1, :, 2:].any()
        assert not parts[2].grad[0, 1, :, 2:].any()
    torch.testing.assert_close(values[1:], [values[0]] * 2, rtol=0.0, atol=0.0)
    given = log_weight, mean, covariance, target
    parts = [(4, of_agent(given, 0, 0)), (2, of_agent(given, 0, 1, 2)), (4, of_agent(given, 1, 1))]
    total = sum(
        steps * trajectory_likelihood_loss(*part, torch.ones(1, 1, steps).double(), 2.0)
        for steps, part in parts
    )
    torch.testing.assert_close(values[0], total / 10.0)


def test_the_weight_of_an_agent_counts_once():
    """A standing agent of weight 0.3 has 0.3 on all its steps, and counts as 0.3 agents."""
    given, ones = random_mixture(), torch.ones(1, 1, 4).double()
    first, second = (trajectory_likelihood_loss(*of_agent(given, 0, n), ones, 2.0) for n in (0, 1))
    mask = torch.tensor([1.0, 0.3]).double().view(1, 2, 1).expand(1, 2, 4)
    value = trajectory_likelihood_loss(*(x[:1] for x in given), mask, 2.0)
    torch.testing.assert_close(value, (first + 0.3 * second) / 1.3)


def test_the_gradient_of_the_likelihood_of_trajectories():
    log_weight, mean, covariance, target = random_mixture(modes=2, steps=3)
    mask = torch.ones(2, 2, 3).double()
    mask[1, 1, 1] = 0.0

    def loss(logits, where, root):
        spread = root @ root.mT + 0.1 * torch.eye(2)
        weight = torch.log_softmax(logits, dim=-1)
        return trajectory_likelihood_loss(weight, where, spread, target, mask, 2.5)

    root = torch.linalg.cholesky(covariance)
    given = [x.clone().requires_grad_() for x in (log_weight, mean, root)]
    assert torch.autograd.gradcheck(loss, given)


def test_nobody_with_a_target_gives_zero():
    given = random_mixture()
    value = trajectory_likelihood_loss(*given, torch.zeros(2, 2, 4).double(), 5.0)
    assert float(value) == 0.0


def two_modes(weights, error, steps=4):
    """One agent with two modes at the truth and ``error`` m beside it; unit covariances."""
    log_weight = torch.tensor(weights).log().view(1, 1, 2).requires_grad_()
    mean = torch.zeros(1, 1, 2, steps, 4)
    mean[0, 0, 1, :, 0] = error
    covariance = torch.eye(4).expand(1, 1, 2, steps, 4, 4).clone().requires_grad_()
    return log_weight, mean.requires_grad_(), covariance, torch.zeros(1, 1, steps, 4)


def test_each_mode_counts_by_its_weight_in_the_likelihood_of_modes():
    log_weight, mean, covariance, target = two_modes([0.75, 0.25], 2.0)
    mask = torch.ones(1, 1, 4)
    given = mode_likelihood_loss(log_weight, mean, covariance, target, mask)
    constant = math.log(2.0 * math.pi)
    nearest = torch.softmax(torch.tensor([0.0, -2.0 / 0.2]), dim=0)
    entropy = -(nearest * torch.tensor([0.75, 0.25]).log()).sum()
    expected = constant + 0.25 * 0.5 * 4.0 + float(entropy.detach())
    assert float(given.detach()) == pytest.approx(expected, rel=1e-5)


def test_weights_learn_which_mode_is_nearest_and_covariances_the_error_of_every_mode():
    log_weight, mean, covariance, target = two_modes([0.5, 0.5], 3.0)
    mask = torch.tensor([[[1.0, 1.0, 0.0, 0.0]]])
    mode_likelihood_loss(log_weight, mean, covariance, target, mask).backward()
    assert log_weight.grad[0, 0, 0] < 0.0  # descending makes the nearest heavier
    far = covariance.grad[0, 0, 1]
    assert (far[:2, 0, 0] < 0.0).all()  # its variance grows where it errs
    assert not far[2:].any()  # not observed
    assert not covariance.grad[..., 2:, 2:].any()  # the position alone
