# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Headings of agents without own frames, and that the baselines use them."""

import math

import pytest
import torch
from model_samples import make_scene

from models.baselines import (
    ConvolutionalSocialLSTM,
    GraphConfig,
    GraphRNN,
    GridConfig,
    MMTransformer,
    RecurrentConfig,
    Seq2Seq,
    SocialLSTM,
    TrajectronConfig,
    TrajectronPlusPlus,
    TransformerConfig,
)
from models.baselines.agent_headings import headings_at_t, yaw_vectors
from mtpgo_core.errors import ConfigurationError

NETWORKS = {
    Seq2Seq: RecurrentConfig,
    SocialLSTM: GridConfig,
    ConvolutionalSocialLSTM: GridConfig,
    GraphRNN: GraphConfig,
    MMTransformer: TransformerConfig,
    TrajectronPlusPlus: TrajectronConfig,
}


def as_angles(features):
    """The same features with the yaw as one column, and a context column after it."""
    angle = torch.atan2(features[..., 7], features[..., 6])
    columns = (features[..., :6], angle.unsqueeze(-1), 30.0 + 0.0 * features[..., :2])
    return torch.cat(columns, dim=-1)


def test_a_yaw_is_two_columns_or_one():
    angle = torch.tensor([[0.3, -2.0]])
    vector = torch.stack((angle.cos(), angle.sin()), dim=-1)
    columns = torch.zeros(1, 2, 9)
    columns[..., 6:8] = vector
    torch.testing.assert_close(yaw_vectors(columns, False), vector)
    columns[..., 6], columns[..., 7] = angle, 30.0
    torch.testing.assert_close(yaw_vectors(columns, True), vector)


def test_the_heading_is_that_of_the_motion_and_at_rest_that_of_the_box():
    features = torch.zeros(1, 2, 3, 7)
    features[0, :, :, 6] = math.pi  # both boxes look along -x
    features[0, 0, :, 3] = 10.0  # the first drives along y
    valid = torch.ones(1, 2, 3, dtype=torch.bool)
    found = headings_at_t(features, valid, True)
    torch.testing.assert_close(found, torch.tensor([[[0.0, 1.0], [-1.0, 0.0]]]))


def test_own_frames_need_the_yaw_as_two_columns():
    with pytest.raises(ConfigurationError, match="yaw_as_angle is True, expected false"):
        RecurrentConfig(yaw_as_angle=True)


@pytest.mark.parametrize("network", NETWORKS)
@torch.no_grad()
def test_without_own_frames_an_agent_drives_on_in_whatever_direction(network):
    """With the inputs of the paper's recipes: the scene frame, the yaw as an angle."""
    torch.manual_seed(0)
    options = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8}
    if network is TrajectronPlusPlus:
        options["wheeled_columns"] = (0,)
    config = NETWORKS[network](feature_size=9, agent_frame=False, yaw_as_angle=True, **options)
    scene = make_scene(3, 6, steps=6, dtype=torch.float32, odd=False)
    scene.static[..., 0] = 1.0
    features = scene.features
    speed = features[:, :, -1, 2:4].norm(dim=-1, keepdim=True)
    features[:, :, -1, 6:8] = features[:, :, -1, 2:4] / speed
    _, mean, _ = network(config).eval()(as_angles(features), scene.valid, scene.static)
    time = 0.2 * torch.arange(1, 6).unsqueeze(-1)
    path = features[:, :, -1, None, :2] + features[:, :, -1, None, 2:4] * time
    moving = speed.squeeze(-1) > 1.0
    assert moving.sum() > 5
    assert (features[:, :, -1, 3][moving].abs() > 1.0).any()  # not all along x
    off = (mean[:, :, 0] - path).norm(dim=-1)[moving]
    assert off.max() < 0.3


@pytest.mark.parametrize("network", [SocialLSTM, ConvolutionalSocialLSTM, MMTransformer])
@torch.no_grad()
def test_without_own_frames_neighbours_are_placed_by_the_heading(network, monkeypatch):
    """Agent 0 drives along y; what it is given of the others depends on that."""
    torch.manual_seed(0)
    options = {"history_steps": 2, "horizon_steps": 2, "modes": 2, "hidden": 8}
    model = network(NETWORKS[network](agent_frame=False, **options)).eval()
    features = torch.zeros(1, 2, 2, 8)
    features[0, 0, :, 3], features[0, 1, :, 2] = 10.0, 10.0
    features[0, 1, :, 1] = 10.0  # 10 m ahead of the first
    valid = torch.ones(1, 2, 2, dtype=torch.bool)
    expected = torch.tensor([[[0.0, 1.0], [1.0, 0.0]]])
    given = []
    if network is MMTransformer:
        whole = model.neighbourhood
        monkeypatch.setattr(model, "neighbourhood", lambda *a: (given.append(a[2]), whole(*a))[1])
    else:
        whole = model.interaction.prepare
        monkeypatch.setattr(
            model.interaction, "prepare", lambda *a: (given.append(a[1]), whole(*a))[1]
        )
    model(features, valid, torch.zeros(1, 2, 8))
    assert given
    for direction in given:
        torch.testing.assert_close(direction, expected)


@torch.no_grad()
def test_neighbours_of_the_latent_network_have_their_headings():
    """The yaw enters its relations as cosine and sine, however the columns have it."""
    options = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8, "edge_hidden": 4}
    scene = make_scene(1, 4, steps=6, dtype=torch.float32, odd=False)
    direction = torch.tensor([1.0, 0.0]).expand(1, 4, 2)
    wheeled = torch.ones(1, 4, dtype=torch.bool)
    found = []
    for features, more in (
        (scene.features, {}),
        (as_angles(scene.features), {"feature_size": 9, "yaw_as_angle": True}),
    ):
        model = TrajectronPlusPlus(TrajectronConfig(agent_frame=False, **options, **more)).eval()
        found.append(model.encoder.edges(features[:, :, -1], scene.present, wheeled, direction))
    torch.testing.assert_close(found[0], found[1])
