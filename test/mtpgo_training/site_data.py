# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A base model that knows constant velocity only, and a site where cars brake."""

import dataclasses

import torch
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_folder import RunFolder

SITE_CONFIG = dataclasses.replace(
    CONFIG,
    data=DataConfig(stride_s=0.8, restart_probability=0.0),
    optimisation=dataclasses.replace(CONFIG.optimisation, batch_scenes=16, average_decay=0.5),
)
"""Few scenes, so that an adaptation takes a second or two."""

BASE_SPLITS = [
    {"name": "01", "source": "home", "layout": "ind", "sha256": "ab", "split": "train"},
]


def base_checkpoint(**changes):
    """A checkpoint of an untrained network, which predicts constant velocity."""
    torch.manual_seed(3)
    config = SITE_CONFIG
    model = build_network(config.network, config.model, config.history, config.scene)
    return {
        "config": dataclasses.asdict(config),
        "network": config.network,
        "model_config": model.config.to_dict(),
        "average": model.state_dict(),
        "epoch": 4,
        "step": 40,
        "covariance_scale": 1.3,
        "metrics": {},
        "splits": BASE_SPLITS,
        **changes,
    }


def write_base(folder, **changes):
    """Write the base model as a run folder and return it."""
    RunFolder(folder).save(base_checkpoint(**changes), best=True)
    return folder


def site(*, seconds=5.0, count=6, tracks=8):
    """Short recordings of one site, of which the last ones validate."""
    return [
        NamedRecording(
            "site", braking_cars(f"{seed:02d}", seed=seed, tracks=tracks, seconds=seconds)
        )
        for seed in range(1, count + 1)
    ]
