# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One step of the decoder written out agent by agent, and the graph it keeps."""

import pytest
import torch
from graph_samples import torch_cell_of
from torch.nn.functional import leaky_relu

from models import ModelConfig
from models.decoder import Decoder
from models.temporal_attention import presence_bias

SIZES = {"hidden": 4, "modes": 2, "history_steps": 5}
B, N = 2, 3


def make_decoder(**choices):
    decoder = Decoder(ModelConfig(**SIZES, **choices)).double()
    torch.nn.init.normal_(decoder.cell.bias)
    return decoder


def make_inputs():
    h, states = torch.randn(B, N, 4).double(), torch.randn(B, N, 2 * 4).double()
    encoded = torch.randn(B, N, 5, 4).double()
    valid = torch.rand(B, N, 5) > 0.3
    valid[..., -1] = True
    return h, states, encoded, valid


@pytest.mark.parametrize("with_trail", [False, True])
@torch.no_grad()
def test_a_step_without_edges_agent_by_agent(with_trail):
    """Eq. 14 to 16 and the GRU update (eq. 6), with loops over agents and steps."""
    decoder = make_decoder(decoder_gnn=False)
    h, states, encoded, valid = make_inputs()
    edges = decoder.prepare(torch.zeros(B, N, 2).double(), valid[..., -1])
    trail = torch.randn(B, N, 4).double() if with_trail else None
    got = decoder(h, states, encoded, presence_bias(valid), edges, trail)
    oracle = torch_cell_of(decoder.cell)
    for b in range(B):
        for n in range(N):
            embedded = decoder.embed(states[b, n])
            if trail is not None:
                embedded = embedded + trail[b, n]
            score = decoder.attention.score(torch.cat((h[b, n], embedded)))
            seen = [t for t in range(5) if valid[b, n, t]]
            total = sum(score[t].exp() for t in seen)
            summary = sum(score[t].exp() / total * encoded[b, n, t] for t in seen)
            f = leaky_relu(decoder.combine(torch.cat((summary, embedded))), 0.2)
            want = oracle(f, h[b, n])
            torch.testing.assert_close(got[b, n], want, rtol=1e-12, atol=1e-12)


@torch.no_grad()
def test_the_graph_is_that_of_the_agents_present_at_t():
    """An absent agent's position, state and history change no other agent's step."""
    decoder = make_decoder()
    h, states, encoded, valid = make_inputs()
    position = 5.0 * torch.randn(B, N, 2).double()
    present = torch.ones(B, N, dtype=torch.bool)
    present[:, 1] = False
    bias = presence_bias(valid)
    before = decoder(h, states, encoded, bias, decoder.prepare(position, present))
    for changed in (h, states, encoded, position):
        changed[:, 1] += 3.0
    after = decoder(h, states, encoded, bias, decoder.prepare(position, present))
    others = [0, 2]
    torch.testing.assert_close(after[:, others], before[:, others], rtol=0.0, atol=0.0)


@torch.no_grad()
def test_distances_enter_through_the_edge_weights_alone():
    """Shifting all agents changes nothing, spreading them out does."""
    decoder = make_decoder()
    h, states, encoded, valid = make_inputs()
    position = 5.0 * torch.randn(B, N, 2).double()
    present, bias = torch.ones(B, N, dtype=torch.bool), presence_bias(valid)
    here, shifted, spread = (
        decoder(h, states, encoded, bias, decoder.prepare(where, present))
        for where in (position, position + 100.0, 3.0 * position)
    )
    torch.testing.assert_close(shifted, here, rtol=1e-9, atol=1e-9)
    assert not torch.allclose(spread, here)
