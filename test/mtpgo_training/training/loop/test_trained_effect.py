# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parts on which a loss of the schedule does not depend are one sentence, not a traceback."""

import pytest
import torch
from tiny_run import CONFIG, new_run, with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.loop.trained_effect import require_effect
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.trainer import train


@pytest.fixture(scope="module")
def recordings():
    return [
        NamedRecording("cars", braking_cars(f"{seed:02d}", seed=seed, tracks=3, seconds=5.0))
        for seed in (1, 2)
    ]


@pytest.fixture(scope="module")
def scenes(recordings):
    horizon = CONFIG.model["horizon_steps"]
    data, guard_s = CONFIG.data, window_s(CONFIG.history, horizon)
    splits = split(recordings, data, 1, guard_s)
    return prepare_scenes(CONFIG, splits, horizon, progress=False).training


@pytest.mark.parametrize("parts", [("noise",), ("initial_covariance", "noise"), ("mixture",)])
def test_parts_that_the_first_loss_does_not_depend_on_are_refused(scenes, parts):
    run = new_run(with_options(train_only=parts))
    with pytest.raises(ConfigurationError, match=r"epoch 1, EWTA\(2\), does not depend") as caught:
        require_effect(run, scenes)
    assert str(list(parts)) in str(caught.value)


@pytest.mark.parametrize(
    ("parts", "warm_up_share"), [(("noise",), 0.0), (("noise", "encoder"), 0.25), ((), 0.25)]
)
def test_parts_that_every_loss_depends_on_are_trained(scenes, parts, warm_up_share):
    run = new_run(with_options(train_only=parts, warm_up_share=warm_up_share))
    before = torch.random.get_rng_state()
    require_effect(run, scenes)
    assert torch.equal(torch.random.get_rng_state(), before)
    assert all(value.requires_grad for value in run.model.parameters())


def test_a_training_is_refused_before_it_has_a_folder(recordings, tmp_path):
    config = with_options(train_only=("noise",))
    with pytest.raises(ConfigurationError, match=r"warm_up_share 0 for those of covariances"):
        train(config, recordings, RunFolder(tmp_path / "r"))
    assert not (tmp_path / "r").exists()
