# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder against one GRU cell per agent, and the rules for absent agents."""

import torch
from graph_samples import torch_cell_of

from models import ModelConfig
from models.encoder import Encoder

SIZE_IN, HIDDEN = 3, 4


def make_encoder(**choices):
    encoder = Encoder(ModelConfig(hidden=HIDDEN, **choices), SIZE_IN).double()
    torch.nn.init.normal_(encoder.initial)
    torch.nn.init.normal_(encoder.cell.bias)
    return encoder


def make_inputs(batch=2, agents=3, steps=5):
    inputs = torch.randn(batch, agents, steps, SIZE_IN).double()
    position = 5.0 * torch.randn(batch, agents, steps, 2).double()
    return inputs, position, torch.ones(batch, agents, steps, dtype=torch.bool)


@torch.no_grad()
def test_without_edges_each_agent_has_a_gru_of_its_own_that_pauses_while_it_is_absent():
    encoder = make_encoder(encoder_gnn=False)
    inputs, position, valid = make_inputs()
    valid[0, 1, :2] = False  # appears late
    valid[1, 2, 3] = False  # a gap
    oracle = torch_cell_of(encoder.cell)
    states = encoder(inputs, position, valid)
    for b in range(2):
        for n in range(3):
            h = encoder.initial
            for t in range(5):
                if valid[b, n, t]:
                    h = oracle(inputs[b, n, t], h)
                torch.testing.assert_close(states[b, n, t], h, rtol=1e-12, atol=1e-12)


@torch.no_grad()
def test_the_state_is_the_learned_first_one_until_the_agent_is_seen():
    encoder = make_encoder()
    inputs, position, valid = make_inputs()
    valid[0, 1, :3] = False
    states = encoder(inputs, position, valid)
    assert (states[0, 1, :3] == encoder.initial).all()
    assert not torch.allclose(states[0, 1, 3], encoder.initial)


@torch.no_grad()
def test_an_absent_agent_is_no_neighbour_at_that_step():
    """Its inputs and position may be anything, and change no state of the others."""
    encoder = make_encoder()
    inputs, position, valid = make_inputs()
    valid[0, 1, 2] = False
    before = encoder(inputs, position, valid)
    inputs[0, 1, 2] = 100.0
    position[0, 1, 2] = 1e4
    after = encoder(inputs, position, valid)
    torch.testing.assert_close(after, before, rtol=0.0, atol=0.0)


@torch.no_grad()
def test_a_state_depends_on_no_later_step():
    encoder = make_encoder()
    inputs, position, valid = make_inputs()
    whole = encoder(inputs, position, valid)
    begun = encoder(inputs[:, :, :3], position[:, :, :3], valid[:, :, :3])
    torch.testing.assert_close(whole[:, :, :3], begun, rtol=1e-12, atol=1e-12)
