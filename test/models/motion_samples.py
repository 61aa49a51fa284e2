# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small motion models and starts for the tests."""

import torch

from models import ModelConfig
from models.neural_ode import NeuralODE
from models.own_frame.agent_frames import Start

H, B, N, M = 4, 2, 3, 5


def make_ode(order, integrator="rk4", layers=1, static=False, wild=True, **options):
    config = ModelConfig(
        order=order,
        integrator=integrator,
        ode_layers=layers,
        ode_hidden=6,
        static_features=static,
        static_size=3,
        **options,
    )
    ode = NeuralODE(config).double()
    if wild:
        with torch.no_grad():
            for parameter in ode.parameters():
                parameter.normal_(0.0, 1.0)
    return config, ode


def make_start():
    direction = torch.tensor([1.0, 0.0]).double().expand(B, N, 2)
    position = torch.randn(B, N, 2).double()
    return Start(position, direction, position, 8.0 * torch.randn(B, N, 2).double())


def definite(*shape):
    """Random positive definite matrices [*shape, shape[-1]]."""
    root = torch.randn(*shape, shape[-1]).double()
    return root @ root.transpose(-1, -2) + 0.1 * torch.eye(shape[-1])


def matrices_last(blocks):
    """[2, 2, H, B, N, M] from [H, B, N, M, 2, 2]."""
    return blocks.permute(4, 5, 0, 1, 2, 3)
