# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss by which a run is trained."""

import dataclasses

import pytest
import tiny_run
import torch
from torch_geometric.data import Batch, Data

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.losses import gradient_accumulation
from mtpgo_training.training.losses.consistency_loss import NO_CONSISTENCY
from mtpgo_training.training.losses.likelihood_loss import (
    negative_log_likelihood,
    trajectory_likelihood_loss,
)
from mtpgo_training.training.run_loss import BatchLoss, trainable_network


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


def test_a_run_that_may_end_early_has_no_last_epochs_for_the_covariances():
    early = {"trainer": {"patience_epochs": 3}}
    for options in (early, {"calibration_epochs": 2}):
        assert trainable_network(tiny_run.with_options(**options))
    with pytest.raises(ConfigurationError, match=r"patience_epochs is 3, expected 0 with"):
        trainable_network(tiny_run.with_options(**early, calibration_epochs=2))


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


def paired_batch(shift_m, scenes=1):
    """Graphs of four agents whose modes a moment later see the past ``shift_m`` farther left."""
    draw = torch.Generator().manual_seed(0)
    classes = len(tiny_run.CONFIG.scene.static_features)
    graphs = []
    for agents in range(4, 4 + scenes):
        x = torch.randn(agents, 16, 8, generator=draw)
        later = x.clone()
        later[..., 3] += shift_m
        graphs.append(
            Data(
                x=x,
                valid=torch.ones(agents, 16, dtype=torch.bool),
                static=torch.zeros(agents, classes),
                target=torch.randn(agents, 5, 4, generator=draw),
                weight=(torch.rand(agents, 5, generator=draw) < 0.7).float(),
                later_x=later,
                later_valid=torch.ones(agents, 16, dtype=torch.bool),
                later_both=torch.ones(agents),
                later_change=torch.eye(2, 3).expand(agents, 2, 3),
                num_nodes=agents,
            )
        )
    return Batch.from_data_list(graphs)


def paired_run(network="mtp-go", **options):
    model = {"hidden": 8, "modes": 3, "horizon_steps": 5}
    data = dataclasses.replace(tiny_run.CONFIG.data, stride_s=0.4)
    config = dataclasses.replace(tiny_run.CONFIG, network=network, model=model, data=data)
    return tiny_run.new_run(tiny_run.with_options(config=config, warm_up_share=0.0, **options))


def test_the_consistency_loss_is_added_in_proportion_to_its_weight():
    def loss(shift_m, **options):
        return float(BatchLoss(paired_run(**options))(paired_batch(shift_m), False).detach())

    alone = loss(2.0)
    once, twice = (loss(2.0, consistency_weight=weight) for weight in (1.0, 2.0))
    assert once - alone > 0.1
    assert twice - alone == pytest.approx(2.0 * (once - alone), rel=1e-3)
    assert loss(4.0, consistency_weight=1.0) > once


def test_the_consistency_loss_does_not_depend_on_the_micro_batches(monkeypatch):
    whole = BatchLoss(paired_run(consistency_weight=3.0))
    expected = whole(paired_batch(2.0, scenes=6), False)
    monkeypatch.setattr(gradient_accumulation, "MICRO_BATCH_AGENTS", 8)
    monkeypatch.setattr(gradient_accumulation, "MIN_MICRO_BATCH_AGENTS", 1)
    parts = gradient_accumulation.micro_batches(paired_batch(2.0, scenes=6))
    assert len(parts) > 2
    torch.testing.assert_close(whole(paired_batch(2.0, scenes=6), False), expected)


def test_no_consistency_loss_where_covariances_are_trained_or_the_objective_is_the_networks_own():
    calibrates = paired_run(consistency_weight=3.0, epochs=2, calibration_epochs=1)
    calibrates.state.epoch = 1
    other = paired_run(epochs=2, calibration_epochs=1)
    other.state.epoch = 1
    batch = paired_batch(2.0)
    torch.testing.assert_close(BatchLoss(calibrates)(batch, False), BatchLoss(other)(batch, False))
    own = paired_run("mmtransformer", consistency_weight=3.0)
    assert BatchLoss(own).consistency == NO_CONSISTENCY
