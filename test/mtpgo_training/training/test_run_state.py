# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The counters of a run, its end, and the moving average of the weights, by hand."""

import dataclasses
import math

import pytest
import torch
from tiny_run import CONFIG, new_run, with_options

from mtpgo_training.training.networks import options_for
from mtpgo_training.training.run_state import RunState


def test_the_loss_of_an_epoch_is_the_average_over_its_agents():
    state = RunState()
    state.count_step(2.0, 10.0)
    state.count_step(5.0, 30.0)
    assert state.mean_loss() == pytest.approx((2.0 * 10 + 5.0 * 30) / 40)
    assert (state.step, state.batch, state.skipped) == (2, 2, 0)


@pytest.mark.parametrize("loss", [math.nan, math.inf])
def test_a_step_that_is_not_finite_counts_as_skipped_and_not_in_the_loss(loss):
    state = RunState()
    state.count_step(3.0, 1.0)
    state.count_step(loss, 100.0)
    assert (state.step, state.batch, state.skipped) == (2, 2, 1)
    assert state.mean_loss() == 3.0
    assert RunState().mean_loss() == 0.0


def test_the_end_of_an_epoch_resets_what_is_counted_per_epoch():
    state = RunState(epoch=2, seconds=10.0, epoch_seconds=2.35)
    state.count_step(1.0, 4.0)
    state.count_step(math.nan, 4.0)
    state.finish_epoch({"loss": 1.0})
    rows = [{"loss": 1.0, "total_seconds": 12.35}]
    assert state == RunState(epoch=3, step=2, seconds=12.35, rows=rows)


def test_a_run_is_finished_after_all_epochs():
    run = new_run()
    run.state.epoch, run.state.best_epoch = 7, 1
    assert not run.finished
    run.state.epoch = 8
    assert run.finished


@pytest.mark.parametrize(("best", "epoch", "finished"), [(5, 6, False), (5, 7, True)])
def test_patience_counts_epochs_since_the_best(best, epoch, finished):
    run = new_run(with_options(trainer={"patience_epochs": 2}))
    run.state.best_epoch, run.state.epoch = best, epoch
    assert run.finished == finished


def test_patience_counts_only_epochs_on_the_likelihood_alone():
    run = new_run(with_options(trainer={"patience_epochs": 2}))
    # Of 8 epochs the EWTA loss counts in the first two.
    assert [run.loss_weights(epoch).ewta > 0.0 for epoch in range(4)] == [True, True, False, False]
    run.state.best_epoch, run.state.epoch = 0, 3
    assert not run.finished
    run.state.epoch = 4
    assert run.finished


def test_patience_waits_for_a_validation():
    """With a validation every third epoch nothing is known of the two after the best one."""
    run = new_run(with_options(trainer={"patience_epochs": 2, "validate_every_epochs": 3}))
    finished = []
    for run.state.epoch in range(7):
        run.state.best_epoch = 3 if run.state.epoch >= 3 else 0
        finished.append(run.finished)
    assert finished == [False] * 6 + [True]
    run.state.best_epoch, run.state.epoch = 0, 2
    assert not run.finished  # before the first validation, from which a checkpoint is exported


def test_teacher_forcing_falls_to_zero_with_the_warm_up_of_the_losses():
    run = new_run(
        with_options(epochs=10, calibration_epochs=2, warm_up_share=0.5, teacher_forcing=0.8)
    )
    found = []
    for run.state.epoch in range(10):
        found.append(run.teacher_forcing_probability())
        assert (found[-1] > 0.0) == (run.loss_weights().ewta > 0.0)
    assert found == pytest.approx([0.8, 0.6, 0.4, 0.2] + [0.0] * 6)


def test_the_average_follows_the_weights_faster_in_the_first_steps():
    run = new_run(with_options(average_decay=0.9))
    one, average = next(run.model.parameters()), next(run.average.parameters())
    start = average.clone()
    with torch.no_grad():
        one.add_(1.0)
    for step, decay in ((10, 0.5), (1000, 0.9)):  # 10 / (10 + 10), then the limit
        with torch.no_grad():
            average.copy_(start)
        run.state.step = step
        run.update_average()
        torch.testing.assert_close(average, decay * start + (1.0 - decay) * one.detach())
    assert not average.requires_grad


@pytest.mark.parametrize(("network", "averages"), [("mtp-go", True), ("trajectron++", False)])
def test_a_network_with_its_own_objective_is_averaged_over_agent_steps(network, averages):
    options = options_for(network, CONFIG.model)
    config = dataclasses.replace(CONFIG, network=network, model=options)
    run = new_run(with_options(config=config, reduction="sum"))
    assert run.averages_agents == averages
    assert not new_run(with_options(config=config)).averages_agents


def test_without_a_decay_the_average_is_the_weights():
    run = new_run()
    with torch.no_grad():
        for value in run.model.parameters():
            value.mul_(3.0)
    run.state.step = 50
    run.update_average()
    for average, value in zip(run.average.parameters(), run.model.parameters(), strict=True):
        torch.testing.assert_close(average, value.detach(), rtol=0.0, atol=0.0)
