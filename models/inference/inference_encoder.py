# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder for inference: one call for all steps where the recurrent state is not needed."""

import torch
from torch import Tensor, nn

from models.encoder import Encoder
from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.graph_gru import GraphGRU
from models.inference.packed_attention import PackedAttention


def gru_step(kappa: list[Tensor], xi: Tensor, h: Tensor, hidden: int) -> Tensor:
    """Return the next state [B, N, D] (GRU update, eq. 6).

    Args:
        kappa: [B, N, 2D] and [B, N, D] of the input, the bias included.
        xi: [B, N, 3D] of the state.
        h: [B, N, D] the state before.
        hidden: D.
    """
    of_gates, of_candidate = xi.split([2 * hidden, hidden], dim=-1)
    r, z = torch.add(kappa[0], of_gates).sigmoid_().chunk(2, dim=-1)
    candidate = torch.addcmul(kappa[1], r, of_candidate).tanh_()
    return torch.lerp(candidate, h, z)


def attentions(cell: GraphGRU) -> tuple[PackedAttention, PackedAttention]:
    """Return the packed attention of the input, with the GRU's bias, and that of the state."""
    return (
        PackedAttention([cell.gnn_f], cell.bias),
        PackedAttention([cell.gnn_h], torch.zeros_like(cell.bias)),
    )


class FastEncoder(nn.Module):
    """Equivalent of :class:`models.encoder.Encoder`."""

    initial: Tensor

    def __init__(self, encoder: Encoder):
        super().__init__()
        self.hidden = encoder.cell.hidden
        self.register_buffer("initial", encoder.initial.detach().clone())
        self.of_input, self.of_state = attentions(encoder.cell)

    def forward(self, inputs: Tensor, position: Tensor, valid: Tensor, scratch: Tensor) -> Tensor:
        """Return the states [B, N, T, D].

        Args:
            inputs: see :meth:`models.encoder.Encoder.forward`.
            position: see there.
            valid: see there.
            scratch: see :func:`models.inference.packed_attention.make_scratch`.
        """
        scenes, agents, steps = valid.size(0), valid.size(1), valid.size(2)
        present = valid.permute(2, 0, 1)  # [T, B, N]
        distance = squared_distances(position.permute(2, 0, 1, 3))
        absent = complete_graph(present).logical_not_()
        graphs = distance.flatten(0, 1), absent.flatten(0, 1)
        edge, fixed = self.of_input.prepare(graphs[0], graphs[1])
        x = inputs.permute(2, 0, 1, 3).reshape(1, steps * scenes * agents, inputs.size(-1))
        kappas = self.of_input(x, edge, fixed, scratch).view(
            steps, scenes, agents, 3 * self.hidden
        )
        of_gates, of_candidate = kappas.split([2 * self.hidden, self.hidden], dim=-1)
        gates, candidates = of_gates.unbind(0), of_candidate.unbind(0)
        edge, fixed = self.of_state.prepare(graphs[0], graphs[1])
        edges = edge.view(1, steps, scenes, agents, agents).unbind(1)
        fixeds = fixed.view(1, steps, scenes, agents, agents).unbind(1)
        all_present = bool(valid.all())
        here = present.unsqueeze(-1).unbind(0)
        h = self.initial.repeat(scenes, agents, 1)
        states: list[Tensor] = []
        for i, gate in enumerate(gates):
            flat = h.view(1, scenes * agents, self.hidden)
            xi = self.of_state(flat, edges[i], fixeds[i], scratch)
            following = gru_step([gate, candidates[i]], xi[0], h, self.hidden)
            h = following if all_present else torch.where(here[i], following, h)
            states.append(h)
        return torch.stack(states, dim=2)
