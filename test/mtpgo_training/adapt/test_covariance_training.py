# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The last part of an adaptation trains the covariances of every mode, and nothing else."""

import signal

import pytest
import torch
from site_data import SITE_CONFIG, base_checkpoint, site, write_base

from mtpgo_core.quality.metrics import nees, radius_squared
from mtpgo_training.adapt import adaptation as module
from mtpgo_training.adapt.adapt_options import AdaptOptions
from mtpgo_training.adapt.adaptation import adapt, adapted_config
from mtpgo_training.adapt.covariance_training import (
    covariance_config,
    covariance_epochs,
    train_covariances,
    trains_covariances,
)
from mtpgo_training.adapt.site_predictions import predict_site
from mtpgo_training.data.splits import split, window_s
from mtpgo_training.export.exporter import load_model
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.loop.trained_parts import CALIBRATED_PARTS
from mtpgo_training.training.networks import build_network

OPTIONS = AdaptOptions(epochs=4, learning_rate=1e-2, num_threads=1)


def trained_on_the_site(checkpoint, times=1):
    """Return the scenes of the site, and the weights with trained covariances."""
    model = load_model(checkpoint)
    config = adapted_config(checkpoint, site(), OPTIONS, "mine")
    splits = split(
        site(), config.data, config.seed, window_s(config.history, model.config.horizon_steps)
    )
    scenes = prepare_scenes(config, splits, model.config.horizon_steps, progress=False)
    epochs = times * covariance_epochs(config, scenes=len(scenes.training))
    run = train_covariances(
        checkpoint,
        covariance_config(config, model, epochs),
        site(),
        scenes,
        max_minutes=1.0,
        progress=False,
    )
    return scenes, run.average.state_dict()


def inside_90(checkpoint, weights, scenes):
    """Return the share of the truths in the 90 % ellipse, over all steps."""
    model = load_model({**checkpoint, "average": weights})
    found = predict_site(model, scenes.validation)
    squared = nees(found.mean, found.weight, found.covariance, found.truth)
    return float((squared <= radius_squared(0.9))[found.mask].mean())


def test_nothing_but_the_covariances_changes():
    checkpoint = base_checkpoint()
    _, weights = trained_on_the_site(checkpoint)
    before = checkpoint["average"]
    changed = {name for name in before if not torch.equal(before[name], weights[name])}
    assert changed
    assert {name.partition(".")[0] for name in changed} <= set(CALIBRATED_PARTS)


def test_ellipses_that_are_far_too_small_hold_more():
    """As after a training on the mixture's likelihood; no calibration is involved."""
    checkpoint = base_checkpoint()
    for name, value in checkpoint["average"].items():
        if name.partition(".")[0] in CALIBRATED_PARTS and name.endswith("bias"):
            value -= 3.0
    scenes, weights = trained_on_the_site(checkpoint, times=3)
    before = inside_90(checkpoint, checkpoint["average"], scenes)
    assert inside_90(checkpoint, weights, scenes) > before + 0.05


def test_an_adaptation_ends_with_it(tmp_path, monkeypatch):
    """What was chosen by the errors of the modes keeps them; its covariances are the new ones."""
    started_with = {}

    def known(checkpoint, config, *arguments, **options):
        started_with.update(checkpoint["average"])
        return train_covariances(checkpoint, config, *arguments, **options)

    monkeypatch.setattr(module, "train_covariances", known)
    found = adapt(write_base(tmp_path / "run"), site(), OPTIONS, name="mine").checkpoint["average"]
    changed = {name for name in found if not torch.equal(found[name], started_with[name])}
    assert changed
    assert {name.partition(".")[0] for name in changed} <= set(CALIBRATED_PARTS)


def test_an_interrupt_in_it_is_passed_on(tmp_path, monkeypatch):
    """The command ends with status 130 then, as in the training before."""

    def interrupted(*arguments, **options):
        run = train_covariances(*arguments, **options)
        run.received_signal = signal.SIGINT
        return run

    monkeypatch.setattr(module, "train_covariances", interrupted)
    found = adapt(write_base(tmp_path / "run"), site(), OPTIONS, name="mine")
    assert found.received_signal == signal.SIGINT


@pytest.mark.parametrize(("scenes", "epochs"), [(1, 960), (96, 10), (959, 2), (960, 1), (0, 960)])
def test_it_has_sixty_steps_or_somewhat_more(scenes, epochs):
    """Of 16 scenes each."""
    config = adapted_config(base_checkpoint(), site(), OPTIONS, "mine")
    assert covariance_epochs(config, scenes) == epochs


@pytest.mark.parametrize(
    ("network", "expected"), [("mtp-go", True), ("seq2seq", True), ("trajectron++", False)]
)
def test_networks_with_an_objective_of_their_own_are_left_as_they_are(network, expected):
    options = {"hidden": 12, "modes": 3, "horizon_steps": 8}
    model = build_network(network, options, SITE_CONFIG.history, SITE_CONFIG.scene)
    assert trains_covariances(network, model) is expected
