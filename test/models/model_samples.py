# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small random scenes, with every kind of presence, and models for the tests."""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from models import MTPGO, ModelConfig
from models.gaussian_mixture import mixture_nll
from models.inference import deployable
from models.trajectory_predictor import TrajectoryPredictor

BEYOND_PAPER = {
    "static_features": True,
    "static_inputs": "all",
    "trail_branches": 3,
    "hold_standing": True,
    "settle_standing": True,
    "stay_bias": 0.6,
    "heaviest_kernels": (0.0, 2.0),
}
"""The options that the paper does not have, together."""

SMALL = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8, "ode_hidden": 5}


@dataclass
class Scene:
    """One batch of model inputs."""

    features: Tensor
    valid: Tensor
    static: Tensor

    @property
    def present(self) -> Tensor:
        """[B, N] valid at t."""
        return self.valid[:, :, -1]

    def inputs(self) -> tuple[Tensor, Tensor, Tensor]:
        return self.features, self.valid, self.static


def make_scene(
    batch: int,
    agents: int,
    steps: int = 16,
    size: int = 8,
    dtype: torch.dtype = torch.float64,
    odd: bool = True,
) -> Scene:
    """Curving agents in [B, N, T, F]; ``odd`` presence: late, gone, one sample, a gap, padding.

    The first agent is always there; agent 1 appears late, 2 leaves early, 3 has one sample, 4 is
    missed for one step, 5 is padding in the first scene, 6 is stationary, if there are that many.
    """
    generator = torch.Generator().manual_seed(100 * batch + agents)
    rand = lambda *shape: torch.randn(*shape, generator=generator, dtype=torch.float64)  # noqa: E731
    time = (torch.arange(steps) - steps + 1).double() * 0.2
    angle = rand(batch, agents, 1) * 2.0 + 0.3 * rand(batch, agents, 1) * time
    speed = 8.0 + 3.0 * rand(batch, agents, 1).abs()
    if agents > 6:
        speed[:, 6] = 0.2
    velocity = speed.unsqueeze(-1) * torch.stack((angle.cos(), angle.sin()), dim=-1)
    position = 15.0 * rand(batch, agents, 1, 2) + velocity * time.unsqueeze(-1)
    yaw = angle + 0.1 * rand(batch, agents, 1)
    parts = (
        position,
        velocity,
        rand(batch, agents, steps, 2),
        torch.stack((yaw.cos(), yaw.sin()), dim=-1),
        rand(batch, agents, steps, size - 8),
    )
    features = torch.cat(parts, dim=-1)
    valid = torch.ones(batch, agents, steps, dtype=torch.bool)
    if odd:
        marks = (
            (1, slice(0, steps // 2), False),
            (2, slice(steps // 2, steps), False),
            (3, slice(0, steps - 1), False),
            (4, slice(steps - 3, steps - 2), False),
        )
        for agent, when, value in marks:
            if agent < agents:
                valid[:, agent, when] = value
        if agents > 5:
            valid[0, 5] = False
    static = torch.nn.functional.one_hot(torch.arange(agents) % 8, 8).double()
    features = features * valid.unsqueeze(-1)
    return Scene(features.to(dtype), valid, static.expand(batch, -1, -1).to(dtype))


def make_trails(
    batch: int, agents: int, branches: int, steps: int, dtype: torch.dtype = torch.float64
) -> Tensor:
    """[B, N, R, H, 3] bending paths that are known up to a random step each (3 m/s^2)."""
    draw = torch.Generator().manual_seed(100 * batch + agents)
    shape = (batch, agents, branches)
    time = 0.2 * torch.arange(1, steps + 1).double().unsqueeze(-1)
    bend = 3.0 * torch.randn(*shape, 1, 2, generator=draw).double()
    share = torch.softmax(torch.randn(*shape, 1, generator=draw).double(), dim=2)
    reach = torch.randint(0, steps + 2, (*shape, 1), generator=draw)
    paths = torch.cat((bend * time**2, share.expand(*shape, steps).unsqueeze(-1)), dim=-1)
    known = torch.arange(steps) < reach
    return (paths * known.unsqueeze(-1)).to(dtype)


def inputs_for(model: TrajectoryPredictor, scene: Scene) -> tuple[Tensor | None, ...]:
    """Return all inputs of a model, with trails if it takes them."""
    config = model.config
    branches = config.trail_branches if isinstance(config, ModelConfig) else 0
    if branches == 0:
        return (*scene.inputs(), None, None)
    size = scene.valid.shape[:2]
    trails = make_trails(*size, branches, config.horizon_steps, scene.features.dtype)
    return (*scene.inputs(), None, trails)


def make_model(dtype: torch.dtype = torch.float64, wild: bool = True, **choices: object) -> MTPGO:
    """Return a small model; ``wild`` gives every weight and scale a random value that matters."""
    model = MTPGO(ModelConfig.from_dict({**SMALL, **choices})).eval()
    if wild:
        with torch.no_grad():
            for name, parameter in model.named_parameters():
                if name.endswith("log_bandwidth"):
                    parameter.copy_(math.log(10.0) + 0.5 * torch.rand(()))
                else:
                    parameter.normal_(0.0, 0.4 if name.startswith("motion") else 0.5)
            condition = model.condition
            condition.input_mean.normal_()
            condition.input_std.uniform_(2.0, 9.0)
            condition.state_mean.normal_()
            condition.state_std.uniform_(3.0, 9.0)
    return model.to(dtype)


def frozen(model: MTPGO) -> torch.jit.ScriptModule:
    """Return the model as it is exported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # torch.jit is, and is what we export
        return torch.jit.freeze(torch.jit.script(deployable(model.eval())))


def save_and_load(model: torch.jit.ScriptModule, path: Path) -> torch.jit.ScriptModule:
    """Return the model after a round trip through a file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.save(model, str(path))
        return torch.jit.load(str(path))


def constant_velocity(scene: Scene, steps: int, dt_s: float = 0.2) -> Tensor:
    """[B, N, H, 2] (m)."""
    last = scene.features[:, :, -1]
    time = dt_s * torch.arange(1, steps + 1, dtype=last.dtype).unsqueeze(-1)
    return last[:, :, None, :2] + last[:, :, None, 2:4] * time


def check_mixed_precision(model: TrajectoryPredictor) -> None:
    """Assert that autocast changes a float32 model's result little, and that it has gradients."""
    scene = make_scene(2, 6, steps=6, dtype=torch.float32)
    inputs = inputs_for(model, scene)
    mean = model(*inputs)[1]
    with torch.autocast("cpu", torch.bfloat16):
        given = model(*inputs)
    torch.testing.assert_close(given[1], mean, rtol=0.0, atol=0.02)
    known = scene.present.unsqueeze(-1).expand(-1, -1, mean.size(3))
    target = torch.zeros(*known.shape, mean.size(-1))
    mixture_nll(*(x.float() for x in given), target, known).sum().backward()
    for name, parameter in model.named_parameters():
        if parameter.numel() == 0:
            continue
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
