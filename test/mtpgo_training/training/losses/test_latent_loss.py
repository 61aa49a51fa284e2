# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The objective of Trajectron++, each part by hand."""

import math

import pytest
import torch
from torch.distributions import Categorical, kl_divergence

from mtpgo_training.training.losses.latent_loss import annealed, divergence, mutual_information


def log(*shares):
    return torch.tensor(shares).log()


def test_the_divergence_by_hand_and_by_torch():
    q, p = log(0.5, 0.5), log(0.25, 0.75)
    expected = 0.5 * math.log(2.0) + 0.5 * math.log(0.5 / 0.75)
    assert float(divergence(q, p)) == pytest.approx(expected)
    other = kl_divergence(Categorical(logits=q), Categorical(logits=p))
    assert float(divergence(q, p)) == pytest.approx(float(other))
    assert float(divergence(p, p)) == 0.0


def test_agents_that_are_sure_of_different_values_have_the_most_information():
    sure = torch.log(torch.tensor([[[0.999999, 1e-6], [1e-6, 0.999999]]]))
    weight = torch.ones(1, 2)
    assert float(mutual_information(sure, weight)) == pytest.approx(math.log(2.0), abs=1e-4)
    alike = log(0.3, 0.7).expand(1, 2, 2)
    assert float(mutual_information(alike, weight)) == pytest.approx(0.0, abs=1e-6)
    only_one = torch.tensor([[1.0, 0.0]])
    assert float(mutual_information(sure, only_one)) == pytest.approx(0.0, abs=1e-4)


def test_the_weight_rises_along_a_sigmoid():
    values = [annealed(2.0, progress, 0.2, 0.05) for progress in (0.0, 0.2, 0.25, 1.0)]
    assert values == pytest.approx([2.0 / (1.0 + math.e**4), 1.0, 2.0 / (1.0 + math.e**-1), 2.0])
