# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss by which a run is trained."""

import tiny_run
import torch

from mtpgo_training.training.losses.likelihood_loss import (
    negative_log_likelihood,
    trajectory_likelihood_loss,
)
from mtpgo_training.training.run_loss import BatchLoss


def test_the_configured_likelihood_is_the_loss():
    draw = torch.Generator().manual_seed(3)
    log_weight = torch.log_softmax(torch.randn(1, 2, 3, generator=draw), dim=-1)
    mean, target = (torch.randn(1, 2, *size, 2, generator=draw) for size in ((3, 4), (4,)))
    covariance = torch.eye(2).expand(1, 2, 3, 4, 2, 2)
    given = log_weight, mean, covariance, target, torch.ones(1, 2, 4)
    expected = {
        ("step", 5.0): negative_log_likelihood(*given),
        ("trajectory", 1.0): trajectory_likelihood_loss(*given, 1.0),
        ("trajectory", 3.0): trajectory_likelihood_loss(*given, 3.0),
    }
    assert len({round(float(value), 4) for value in expected.values()}) == 3
    for (likelihood, steps), value in expected.items():
        options = tiny_run.with_options(likelihood=likelihood, correlated_steps=steps)
        loss = BatchLoss(tiny_run.new_run(options)).likelihood
        torch.testing.assert_close(loss(*given), value)
