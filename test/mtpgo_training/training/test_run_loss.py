# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss by which a run is trained."""

import dataclasses

import pytest
import tiny_run
import torch
from torch_geometric.data import Batch, Data

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


@pytest.mark.parametrize("network", ["mtp-go", "mmtransformer", "trajectron++"])
def test_the_huber_losses_are_added_to_the_objective_of_any_network(network):
    """Whether it is the common likelihood or an objective of its own."""
    model = {"hidden": 8, "modes": 3, "horizon_steps": 5}
    config = dataclasses.replace(tiny_run.CONFIG, network=network, model=model)
    draw = torch.Generator().manual_seed(0)
    data = Data(
        x=torch.randn(4, 16, 8, generator=draw),
        valid=torch.ones(4, 16, dtype=torch.bool),
        static=torch.zeros(4, len(config.scene.static_features)),
        target=torch.randn(4, 5, 4, generator=draw),
        weight=torch.ones(4, 5),
    )

    def loss(**options):
        run = tiny_run.new_run(tiny_run.with_options(config=config, warm_up_share=0.0, **options))
        return float(BatchLoss(run)(Batch.from_data_list([data]), False).detach())

    alone = loss()
    of_mean = loss(mean_weight=2.0) - alone
    of_heaviest = loss(heaviest_weight=3.0) - alone
    assert of_mean > 0.1
    assert of_heaviest > 0.1
    both = loss(mean_weight=2.0, heaviest_weight=3.0)
    assert both == pytest.approx(alone + of_mean + of_heaviest, rel=1e-4)
