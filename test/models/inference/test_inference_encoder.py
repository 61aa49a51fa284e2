# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder for inference against the one that is trained."""

import pytest
import torch
from model_samples import make_model, make_scene

from models.inference.inference_encoder import FastEncoder, gru_step
from models.inference.packed_attention import make_scratch


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("layer", ["gat", "gat+"])
@torch.no_grad()
def test_the_states_are_those_of_the_encoder(layer, odd):
    """With and without absent agents, which take different branches."""
    plain = make_model(layer=layer).encoder
    scene = make_scene(2, 7, steps=6, odd=odd)
    inputs = torch.randn(2, 7, 6, plain.cell.gnn_f.layers[0].packed.in_features).double()
    position = scene.features[..., :2]
    got = FastEncoder(plain).double()(inputs, position, scene.valid, make_scratch(inputs, 7, 24))
    torch.testing.assert_close(got, plain(inputs, position, scene.valid), rtol=1e-10, atol=1e-10)


@torch.no_grad()
def test_a_gru_step_is_torchs_gru_cell():
    oracle = torch.nn.GRUCell(3, 4).double()
    x, h = torch.randn(5, 3).double(), torch.randn(5, 4).double()
    kappa = (x @ oracle.weight_ih.t() + oracle.bias_ih).split([8, 4], dim=-1)
    xi = h @ oracle.weight_hh.t() + oracle.bias_hh
    got = gru_step(list(kappa), xi, h, 4)
    torch.testing.assert_close(got, oracle(x, h), rtol=1e-12, atol=1e-12)
