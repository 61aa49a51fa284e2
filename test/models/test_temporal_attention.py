# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Temporal attention (eq. 14 and 15) worked by hand."""

import math

import torch

from models.temporal_attention import TemporalAttention, presence_bias

SKIPPED = float("-inf")


def test_only_samples_that_were_seen_get_a_weight():
    valid = torch.tensor([[[True, False, True], [True, True, False]]])
    assert presence_bias(valid).tolist() == [[[0.0, SKIPPED, 0.0], [0.0, 0.0, SKIPPED]]]


def test_an_agent_that_was_never_seen_attends_to_the_last_step():
    assert presence_bias(torch.zeros(1, 1, 3).bool()).tolist() == [[[SKIPPED, SKIPPED, 0.0]]]


@torch.no_grad()
def test_a_summary_by_hand():
    """Scores log 1, log 3 and log 4 of three steps, of which the last is missing: 1/4 and 3/4."""
    attention = TemporalAttention(1, 3).double()
    attention.score.bias.zero_()
    logs = [0.0, math.log(3.0), math.log(4.0)]
    # From h = 2 and the embedded state 1: half of each score from either.
    weight = [[0.25 * score, 0.5 * score] for score in logs]
    attention.score.weight.copy_(torch.tensor(weight))
    h, embedded = torch.full((1, 1, 1), 2.0).double(), torch.ones(1, 1, 1).double()
    encoded = torch.tensor([8.0, 4.0, 1000.0]).double().view(1, 1, 3, 1)
    bias = presence_bias(torch.tensor([[[True, True, False]]]))
    summary = attention(h, embedded, encoded, bias)
    torch.testing.assert_close(summary, torch.tensor([[[8.0 / 4 + 4.0 * 3 / 4]]]).double())


@torch.no_grad()
def test_equal_scores_average_the_history():
    attention = TemporalAttention(2, 4).double()
    attention.score.weight.zero_()
    attention.score.bias.fill_(7.0)
    encoded = torch.randn(3, 5, 4, 2).double()
    h = torch.randn(3, 5, 2).double()
    summary = attention(h, h, encoded, torch.zeros(3, 5, 4).double())
    torch.testing.assert_close(summary, encoded.mean(dim=2))
