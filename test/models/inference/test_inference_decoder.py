# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A step of the decoder for inference against the one that is trained, on scaled states."""

import pytest
import torch
from model_samples import make_model

from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.inference.inference_decoder import FastDecoder
from models.inference.packed_attention import make_scratch
from models.temporal_attention import presence_bias

B, N, T, M, D = 2, 5, 6, 3, 8  # of the small model


@pytest.mark.parametrize("choices", [{}, {"layer": "gat"}, {"tied": False}], ids=str)
@torch.no_grad()
def test_a_step_is_that_of_the_decoder(choices):
    model = make_model(**choices)
    fast = FastDecoder(model.decoder, model.condition, M).double()
    h, encoded = torch.randn(B, N, D).double(), torch.randn(B, N, T, D).double()
    deviation = 5.0 * torch.randn(B, N, M, 4).double()
    position = 10.0 * torch.randn(B, N, 2).double()
    valid = torch.rand(B, N, T) > 0.3
    present, bias = valid[..., -1], presence_bias(valid)

    condition = model.condition
    scaled = ((deviation - condition.state_mean) / condition.state_std).flatten(2)
    edges = model.decoder.prepare(position, present)
    want = model.decoder(h, scaled, encoded, bias, edges)

    absent = complete_graph(present).logical_not()
    edge, fixed = fast.gnn.prepare(squared_distances(position), absent)
    got = fast(
        h.flatten(0, 1),
        deviation.view(B * N, M * 4),
        *fast.prepare(encoded, bias),
        edge,
        fixed,
        make_scratch(h, N, fast.gnn.size),
    )
    torch.testing.assert_close(got.view(B, N, D), want, rtol=1e-10, atol=1e-10)


@torch.no_grad()
def test_embedded_trails_are_added_as_in_the_decoder():
    model = make_model()
    fast = FastDecoder(model.decoder, model.condition, M).double()
    h, encoded = torch.randn(B, N, D).double(), torch.randn(B, N, T, D).double()
    states, trail = torch.randn(B, N, M * 4).double(), torch.randn(2, B, N, D).double()
    everywhere, position = torch.zeros(B, N, T).double(), torch.zeros(B, N, 2).double()
    present = torch.ones(B, N, dtype=torch.bool)
    edges = model.decoder.prepare(position, present)
    want = model.decoder(h, states, encoded, everywhere, edges, trail[1])
    # The fast form sees unscaled states.
    condition = model.condition
    deviation = states.view(B, N, M, 4) * condition.state_std + condition.state_mean
    summaries, constant = fast.prepare(encoded, everywhere)
    got = fast(
        h.flatten(0, 1),
        deviation.view(B * N, M * 4),
        summaries,
        constant + fast.of_trails(trail)[1],
        *fast.gnn.prepare(squared_distances(position), complete_graph(present).logical_not()),
        make_scratch(h, N, fast.gnn.size),
    )
    torch.testing.assert_close(got.view(B, N, D), want, rtol=1e-10, atol=1e-10)


@torch.no_grad()
def test_missing_samples_get_no_weight():
    """What the encoder left at a sample without an observation does not matter."""
    model = make_model()
    fast = FastDecoder(model.decoder, model.condition, M).double()
    encoded, valid = torch.randn(1, 1, T, D).double(), torch.ones(1, 1, T, dtype=torch.bool)
    valid[..., 2] = False
    h, deviation = torch.randn(1, D).double(), torch.randn(1, M * 4).double()
    graph = torch.zeros(1, 1, 1).double()
    edge, fixed = fast.gnn.prepare(graph, graph > 0)
    scratch = make_scratch(h, 1, fast.gnn.size)
    results = []
    for value in (0.0, 1e3):
        encoded[..., 2, :] = value
        summaries, constant = fast.prepare(encoded, presence_bias(valid))
        results.append(fast(h, deviation, summaries, constant, edge, fixed, scratch))
    torch.testing.assert_close(results[1], results[0], rtol=0.0, atol=0.0)
