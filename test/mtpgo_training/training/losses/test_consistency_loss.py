# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of modes that move from one instant to the next, by hand."""

import math

import pytest
import torch

from mtpgo_training.training.losses.consistency_loss import ConsistencyTerm, consistency_loss

STEPS, H = 2, 5


def paths(first_m):
    """[1, 1, 2, H, 2] two modes at 1 m a step along x, from ``first_m`` on; mode 1 is 4 m left."""
    path = torch.zeros(1, 1, 2, H, 2)
    path[..., 0] = first_m + torch.arange(H)
    path[0, 0, 1, :, 1] = 4.0
    return path


WEIGHT = torch.tensor([0.75, 0.25]).view(1, 1, 2)
SEEN, BOTH = torch.ones(1, 1, H), torch.ones(1, 1)


def test_predictions_that_agree_about_the_same_times_cost_nothing():
    assert float(consistency_loss(WEIGHT, paths(0.0), paths(2.0), SEEN, BOTH, STEPS)) == 0.0


def test_a_mode_that_moves_costs_its_huber_loss_times_its_weight():
    """The second mode moves by 3 m: 2.5 for each of three steps that both predict, of five."""
    moved = paths(2.0)
    moved[0, 0, 1, :, 1] += 3.0
    loss = consistency_loss(WEIGHT, paths(0.0), moved, SEEN, BOTH, STEPS)
    assert float(loss) == pytest.approx(0.25 * 3 * 2.5 / 5)
    smaller = consistency_loss(WEIGHT, paths(0.0), moved, SEEN, BOTH, STEPS, 0.2)
    assert float(smaller) == pytest.approx(0.25 * 3 * 0.2 * (3.0 - 0.1) / 5)


def test_only_agents_in_both_and_observed_steps_count():
    two = paths(0.0).expand(1, 2, 2, H, 2)
    later = two + 2.0
    seen = torch.ones(1, 2, H)
    seen[0, 0, 3:] = 0.0
    both = torch.tensor([[1.0, 0.0]])
    loss = consistency_loss(WEIGHT.expand(1, 2, 2), two, later, seen, both, STEPS)
    # One step (the third) of one agent; y is off by 2 m: 1.5. Eight observed agent-steps.
    assert float(loss) == pytest.approx(1.5 / 8)


def test_both_predictions_learn_and_the_weights_do_not():
    earlier, later = paths(0.0).requires_grad_(), (paths(2.0) + 1.0).requires_grad_()
    weight = WEIGHT.clone().requires_grad_()
    consistency_loss(weight, earlier, later, SEEN, BOTH, STEPS).backward()
    assert earlier.grad[..., STEPS:, :].all()
    assert later.grad[..., : H - STEPS, :].all()
    torch.testing.assert_close(earlier.grad.sum(), -later.grad.sum())
    assert weight.grad is None


@pytest.mark.parametrize("first_m", [0.0, 90.7])
@pytest.mark.parametrize("mixed", [False, True])
def test_the_term_compares_in_the_frame_of_the_earlier_scene(first_m, mixed):
    """The later frame is turned by 90 degrees and lies 7 m along x.

    Places far away are compared in full precision: bfloat16 has a grid of half a metre there.
    """
    turn, x_m = math.pi / 2, 7.0
    earlier = paths(first_m)
    shifted = paths(first_m + 2.0) - torch.tensor([x_m, 0.0])
    later = torch.stack([shifted[..., 1], -shifted[..., 0]], dim=-1)  # as seen from there
    c, s = math.cos(turn), math.sin(turn)
    change = torch.tensor([[c, -s, x_m], [s, c, 0.0]]).expand(1, 1, 2, 3)
    fields = {"later_change": change, "later_both": BOTH, "weight": SEEN}
    velocity = torch.zeros_like(earlier)
    states = [torch.cat([path, velocity], dim=-1) for path in (earlier, later, later + 1.0)]
    term = ConsistencyTerm(weight=3.0, steps=STEPS)
    with torch.autocast("cpu", torch.bfloat16, enabled=mixed):
        same = term(WEIGHT.log(), states[0], WEIGHT.log(), states[1], fields)
        other = term(WEIGHT.log(), states[0], WEIGHT.log(), states[2], fields)
    assert float(same) == pytest.approx(0.0, abs=1e-8)
    assert float(other) == pytest.approx(3.0 * 3 * (0.5 + 0.5) / 5, rel=1e-4)
