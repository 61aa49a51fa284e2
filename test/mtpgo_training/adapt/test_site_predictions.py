# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which predictions of a network are kept for the calibration of a site."""

import numpy as np
import torch
from site_data import predictions
from torch_geometric.loader import DataLoader
from traffic import braking_cars

from mtpgo_core.prediction.paths.mode_spread import with_least_spread
from mtpgo_core.task.calibration import Calibration
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.adapt.site_predictions import predict_site
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import dense, validation_scenes
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.training_config import DataConfig
from mtpgo_training.training.validation import validate

HISTORY, SCENE, H = HistoryConfig(), SceneConfig(max_neighbours=3), 8
OPTIONS = {"hidden": 8, "modes": 3, "horizon_steps": H, "ode_hidden": 4}


def test_an_agent_counts_once_an_instant_if_its_future_was_observed():
    data = DataConfig(validation_stride_s=2.0)
    source = prepare(braking_cars(), HISTORY, SCENE, data, training=False)
    scenes = list(validation_scenes([source], HISTORY, SCENE, H))
    scenes[0].weight[:] = 0.0  # nothing that follows was observed
    torch.manual_seed(0)
    network = build_network("mtp-go", OPTIONS, HISTORY, SCENE)
    found = predict_site(network, scenes)
    scored = validate(network, [dense(batch) for batch in DataLoader(scenes, batch_size=16)])[0]
    n = scored.averages()["model"]["all"]["n"]
    assert found.mean.shape == (n, 3, H, 2)
    assert found.covariance.shape == (n, 3, H, 2, 2)
    assert found.truth.shape == found.constant_velocity.shape == (n, H, 2)
    assert found.mask.any(axis=1).all()
    np.testing.assert_allclose(found.weight.sum(axis=1), 1.0, rtol=1e-5)


def test_modes_are_as_far_apart_as_they_are_published():
    source = prepare(braking_cars(), HISTORY, SCENE, DataConfig(), training=False)
    scenes = list(validation_scenes([source], HISTORY, SCENE, H))

    def predicted(least):
        torch.manual_seed(0)
        options = OPTIONS | {"least_mode_spread": least}
        return predict_site(build_network("mtp-go", options, HISTORY, SCENE), scenes)

    plain, found = predicted(0.0), predicted(0.5)
    expected = with_least_spread(plain.mean, plain.weight, plain.covariance, 0.5, 0.2)
    assert np.abs(expected - plain.mean).max() > 0.1
    np.testing.assert_allclose(found.mean, expected, rtol=1e-6)


def test_without_a_calibration_predictions_are_as_given():
    given = predictions(np.ones((4, 2)))
    assert given.calibrated(Calibration()) is given
