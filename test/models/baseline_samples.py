# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small baselines for the tests."""

import pytest
import torch

from models.baselines import (
    ConvolutionalSocialLSTM,
    GraphConfig,
    GraphRNN,
    GridConfig,
    RecurrentConfig,
    Seq2Seq,
    SocialLSTM,
)

KINDS = {
    "seq2seq": (Seq2Seq, RecurrentConfig),
    "s-lstm": (SocialLSTM, GridConfig),
    "cs-lstm": (ConvolutionalSocialLSTM, GridConfig),
    "gnn-rnn": (GraphRNN, GraphConfig),
}
ALL = pytest.mark.parametrize("name", KINDS)
SMALL = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8, "embedding": 6}


def make_baseline(name, dtype=torch.float64, wild=True, **choices):
    """Return a small baseline; ``wild`` gives every weight and scale a random value."""
    network, config = KINDS[name]
    model = network(config.from_dict({**SMALL, **choices})).eval()
    if wild:
        with torch.no_grad():
            for parameter in model.parameters():
                if parameter.dim() > 0:  # not the bandwidths
                    parameter.normal_(0.0, 0.5)
            condition = model.condition
            condition.input_mean.normal_()
            condition.input_std.uniform_(2.0, 9.0)
            condition.state_mean.normal_()
            condition.state_std.uniform_(3.0, 9.0)
    return model.to(dtype)


def close(results, others, tolerance=1e-9):
    for one, other in zip(results, others, strict=True):
        torch.testing.assert_close(one, other, rtol=tolerance, atol=tolerance)
