# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A base model that knows constant velocity only, a site where cars brake, known predictions."""

import dataclasses

import numpy as np
import torch
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_core.task.calibration import calibration_groups
from mtpgo_training.adapt.site_predictions import SitePredictions
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


def predictions(error, sigma=1.0, speed=10.0, known=None, cv_error=3.0):
    """One mode whose errors along x are ``error`` [n, H] (m), with a circular covariance."""
    error = np.asarray(error, dtype=np.float32)
    n, h = error.shape
    truth = np.zeros((n, h, 2), np.float32)
    mean = np.zeros((n, 1, h, 2), np.float32)
    mean[:, 0, :, 0] = error
    straight = np.zeros((n, h, 2), np.float32)
    straight[..., 1] = cv_error
    covariance = np.broadcast_to(sigma**2 * np.eye(2), (n, 1, h, 2, 2)).copy()
    mask = np.ones((n, h), np.bool_) if known is None else np.asarray(known)
    velocity = np.stack([np.broadcast_to(speed, n), np.zeros(n)], axis=1)
    return SitePredictions(
        weight=np.ones((n, 1)),
        mean=mean,
        covariance=covariance,
        truth=truth,
        mask=mask,
        constant_velocity=straight,
        group=calibration_groups(np.ones(n, np.uint8), velocity),
        site=np.zeros(n, np.int64),
        sites=("here",),
        step_s=1.0,
    )
