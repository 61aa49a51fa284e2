# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's summed losses against eqs. (27) and (28) written out, and what goes with them."""

import math

import pytest
import torch
from tiny_run import CONFIG, new_run, with_options

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.losses.ewta_loss import ewta_loss
from mtpgo_training.training.losses.gradient_accumulation import split_fields
from mtpgo_training.training.losses.likelihood_loss import summed_negative_log_likelihood
from mtpgo_training.training.training_config import OptimisationConfig


def test_summed_ewta_by_hand():
    """Two agents, one step of one missing; errors of 2 m in one state cost 1.5 each (Huber)."""
    mean = torch.zeros(1, 2, 3, 2, 2)
    mean[0, :, 1, :, 0], mean[0, :, 2, :, 0] = 2.0, 3.0  # per step: 0, 1.5 and 2.5
    target, mask = torch.zeros(1, 2, 2, 2), torch.tensor([[[1.0, 1.0], [1.0, 0.0]]])
    # K = 2: agent 1: 2 (0 + 1.5), agent 2: 1 (0 + 1.5); averaged over two agents.
    assert float(ewta_loss(mean, target, mask, 2, summed=True)) == pytest.approx(4.5 / 2)
    assert float(ewta_loss(mean, target, mask, 3, summed=True)) == pytest.approx(12.0 / 2)
    assert float(ewta_loss(mean, target, mask, 2)) == pytest.approx(4.5 / 2 / 3)


def test_summed_likelihood_by_hand():
    """-sum_k log sum_j pi_j N(x_k | x_k^j, I) of two modes, two steps, one agent."""
    weight = torch.tensor([0.25, 0.75])
    mean = torch.zeros(1, 1, 2, 2, 2)
    mean[0, 0, 1, :, 0] = 1.0
    covariance = torch.eye(2).expand(1, 1, 2, 2, 2, 2)
    target, mask = torch.zeros(1, 1, 2, 2), torch.ones(1, 1, 2)
    density = (0.25 + 0.75 * math.exp(-0.5)) / (2.0 * math.pi)
    given = weight.log().view(1, 1, 2), mean, covariance, target
    found = summed_negative_log_likelihood(*given, mask)
    assert float(found) == pytest.approx(-2.0 * math.log(density), rel=1e-5)
    mask[0, 0, 1] = 0.0
    found = summed_negative_log_likelihood(*given, mask)
    assert float(found) == pytest.approx(-math.log(density), rel=1e-5)


def test_micro_batches_count_agents():
    """Three scenes of 1, 1 and 2 agents, one of them never observed."""
    weight = torch.zeros(3, 2, 2)
    weight[0, 0] = 1.0
    weight[1, 0, 0] = 1.0
    weight[2] = torch.tensor([[1.0, 1.0], [0.0, 0.0]])
    fields = {"weight": weight, "x": torch.zeros(3, 2)}
    parts = split_fields(fields, [1, 1, 2], 2, by_agent=True)
    assert sorted(round(part.share, 6) for part in parts) == [0.333333, 0.666667]
    assert sum(part.share for part in split_fields(fields, [1, 1, 2], 2)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "other",
    [{"mean_weight": 0.5}, {"heaviest_weight": 1.0}, {"likelihood": "trajectory"}],
    ids=lambda other: next(iter(other)),
)
def test_sums_are_the_papers_losses_only(other):
    with pytest.raises(ConfigurationError, match=r"optimisation.reduction is 'sum', expected"):
        OptimisationConfig(reduction="sum", **other)


def test_teacher_forcing_throughout():
    run = new_run(with_options(teacher_forcing=1.0, teacher_forcing_schedule="constant"))
    fading = new_run(with_options(teacher_forcing=1.0))
    for run.state.epoch in range(CONFIG.optimisation.epochs):
        assert run.teacher_forcing_probability() == 1.0
    fading.state.epoch = CONFIG.optimisation.epochs - 1
    assert fading.teacher_forcing_probability() == 0.0
