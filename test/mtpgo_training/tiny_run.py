# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training run of a tiny network, without a training."""

import dataclasses

import torch

from mtpgo_core.task.task_description import SceneConfig
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import OptimisationConfig, TrainingConfig

CONFIG = TrainingConfig(
    name="tiny",
    num_threads=1,
    scene=SceneConfig(max_neighbours=3),
    model={
        "hidden": 8,
        "modes": 2,
        "horizon_steps": 5,
        "layer": "graphconv",
        "integrator": "euler",
        "ode_hidden": 4,
    },
    optimisation=OptimisationConfig(epochs=8, batch_scenes=4),
)


def new_run(config=CONFIG, seed=0):
    """A run at its start, with the random weights of a seed."""
    torch.manual_seed(seed)
    model = build_network(config.network, config.model, config.history, config.scene)
    return TrainingRun(model, config)


def with_options(*, trainer=(), config=CONFIG, **optimisation):
    """The configuration with other values in the sections optimisation and trainer."""
    return dataclasses.replace(
        config,
        optimisation=dataclasses.replace(config.optimisation, **optimisation),
        trainer=dataclasses.replace(config.trainer, **dict(trainer)),
    )
