# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The reference network's parts, against numbers worked by hand."""

import pytest
import torch

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from mtpgo_training.benchmark.reference_mtp_go import (
    ReferenceMotion,
    ReferenceMTPGO,
    edge_list,
)

DT = 0.2
"""Time between two steps of the default configuration (s)."""


def test_edges_by_hand():
    """Two scenes: of 0, 1, 2 the middle one is absent and keeps its loop; 3 is alone."""
    scene = torch.tensor([0, 0, 0, 1])
    edges = edge_list(scene, torch.tensor([True, False, True, True]))
    assert edges.t().tolist() == [[0, 0], [2, 0], [1, 1], [0, 2], [2, 2], [3, 3]]


def reference(**options):
    """Return the reference network on the weights of an untrained model."""
    torch.manual_seed(0)
    config = ModelConfig(hidden=8, modes=2, **options)
    return ReferenceMTPGO(config, MTPGO(config).state_dict())


@pytest.mark.parametrize(
    ("order", "integrator", "expected"),
    [
        # From (1, 2) m at (3, 4) m/s with the inputs (5, 6) m/s^2 or m/s, by hand.
        (2, "euler", [1.6, 2.8, 4.0, 5.2]),  # the position does not see the acceleration
        (2, "heun", [1.7, 2.92, 4.0, 5.2]),  # exact: 0.5 a dt^2 = (0.1, 0.12)
        (2, "rk4", [1.7, 2.92, 4.0, 5.2]),
        (1, "rk4", [2.0, 3.2]),  # the inputs are the velocity
    ],
)
def test_a_step_with_constant_inputs_is_integrated_by_hand(order, integrator, expected):
    """With a network that returns zero the rate is the input alone, eq. (18) and (19)."""
    network = reference(order=order, integrator=integrator, static_features=False)
    weights = dict(network.w)
    for name in ("motion.last", "motion.last_bias"):
        weights[name] = torch.zeros_like(weights[name])
    motion = ReferenceMotion(network.config, weights)
    state = torch.tensor([1.0, 2.0, 3.0, 4.0])[: 2 * order]
    following = motion.step(state, torch.tensor([5.0, 6.0]), torch.zeros(0))
    torch.testing.assert_close(following, torch.tensor(expected))


@pytest.mark.parametrize(("noise_input", "upper"), [("velocity", 0.0), ("integrated", DT / 2)])
def test_the_covariance_of_one_step_by_hand(noise_input, upper):
    """EKF time update, eq. (21b), along one axis with F = [[1, T], [0, 1]], P = 1 and Q = 4."""
    network = reference(noise_input=noise_input)
    f = torch.eye(4)
    f[:2, 2:] = DT * torch.eye(2)
    p = network.kalman(torch.eye(4)[None, None], f[None, None], 4.0 * torch.eye(2)[None, None])
    g = torch.tensor([DT * upper, DT])
    expected = torch.tensor([[1.0 + DT**2, DT], [DT, 1.0]]) + 4.0 * torch.outer(g, g)
    expected = expected * (1.0 + 1e-5 * torch.eye(2))
    for axis in (0, 1):
        torch.testing.assert_close(p[0, 0][axis::2, axis::2], expected)
        torch.testing.assert_close(p[0, 0][axis::2, 1 - axis :: 2], torch.zeros(2, 2))


def test_states_return_from_the_agents_frames():
    network = reference()
    angle = torch.tensor([0.3, -2.0])
    cos, sin = angle.cos(), angle.sin()
    turn = torch.stack((cos, -sin, sin, cos), dim=-1).view(2, 2, 2)
    origin = torch.tensor([[5.0, -3.0], [100.0, 7.0]])
    states = torch.randn(2, 4)
    own = network.into_frames(states, origin, turn)
    back = network.into_scene(own[:, None, None], origin, turn)
    torch.testing.assert_close(back[:, 0, 0], states)
    # An agent at its origin that moves along its heading moves along x of its frame.
    ahead = torch.cat((origin, 2.0 * torch.stack((cos, sin), dim=-1)), dim=-1)
    expected = torch.tensor([0.0, 0.0, 2.0, 0.0]).expand(2, 4)
    torch.testing.assert_close(
        network.into_frames(ahead, origin, turn), expected, atol=1e-6, rtol=0
    )
