# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The decoder's step for inference: from deviations and hidden states to commands."""

import torch
from torch import Tensor, nn

from models.decoder import Decoder
from models.inference.inference_encoder import gru_step
from models.inference.packed_attention import PackedAttention
from models.own_frame.conditioning import Conditioning


class FastDecoder(nn.Module):
    """Equivalent of :class:`models.decoder.Decoder`, including the scaling of its states.

    The embedding W_x x + b_x only enters other linear maps, so it is multiplied into the
    temporal attention's scores and into W_f; W_f's half for the summary acts on the encoded
    states beforehand, because a weighted sum and a linear map commute. Both GNNs, of
    the input f and of the state h, run as one on stacked [f; h].
    """

    embed: Tensor
    of_h: Tensor
    shift: Tensor
    both: Tensor
    of_summary: Tensor
    initial: Tensor

    def __init__(self, decoder: Decoder, condition: Conditioning, modes: int):
        super().__init__()
        hidden, steps = decoder.cell.hidden, decoder.attention.score.out_features
        self.hidden, self.steps = hidden, steps
        cell = decoder.cell
        self.gnn = PackedAttention([cell.gnn_f, cell.gnn_h], cell.bias)
        std = condition.state_std.double().repeat(modes)
        mean = condition.state_mean.double().repeat(modes)
        embed = decoder.embed.weight.detach().double() / std
        shift = decoder.embed.bias.detach().double() - embed @ mean
        score = decoder.attention.score.weight.detach().double()
        combine = decoder.combine.weight.detach().double()
        both = torch.cat((score[:, hidden:], combine[:, hidden:]))  # [T + D, D]
        bias = torch.cat((decoder.attention.score.bias, decoder.combine.bias)).detach().double()
        self.register_buffer("embed", (both @ embed).t().contiguous())  # [M S, T + D]
        self.register_buffer("shift", both @ shift + bias)
        self.register_buffer("both", both.t().contiguous())
        self.register_buffer("of_h", score[:, :hidden].t().contiguous())
        self.register_buffer("of_summary", combine[:, :hidden].t().contiguous())
        self.register_buffer("initial", decoder.initial.detach().clone())

    def of_trails(self, embedded: Tensor) -> Tensor:
        """Return [H, B N, T + D] constants of all steps from embedded trails [H, B, N, D]."""
        return torch.matmul(embedded.flatten(1, 2), self.both)

    def prepare(self, encoded: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
        """Return [B N, T, D] W_f's part of each encoder state, and [B N, T + D] constants.

        Args:
            encoded: [B, N, T, D] encoder states.
            bias: [B, N, T] of :func:`models.temporal_attention.presence_bias`.
        """
        summaries = torch.matmul(encoded, self.of_summary).flatten(0, 1)
        constant = self.shift.repeat(summaries.size(0), 1)
        constant[:, : self.steps].add_(bias.flatten(0, 1))
        return summaries, constant

    def forward(
        self,
        h: Tensor,
        deviation: Tensor,
        summaries: Tensor,
        constant: Tensor,
        edge: Tensor,
        fixed: Tensor,
        scratch: Tensor,
    ) -> Tensor:
        """Return the next state [B N, D].

        Args:
            h: [B N, D] the state before.
            deviation: [B N, M S] of the agent states from uniform motion.
            summaries: result of :meth:`prepare`.
            constant: result of :meth:`prepare`.
            edge: [2, B, N, N] edge weights of both GNNs, see :meth:`PackedAttention.prepare`.
            fixed: [2, B, N, N] scores from the graph alone, see there.
            scratch: see :func:`models.inference.packed_attention.make_scratch`.
        """
        score, rest = torch.addmm(constant, deviation, self.embed).split(
            [self.steps, self.hidden], dim=1
        )
        alpha = torch.softmax(torch.addmm(score, h, self.of_h), dim=1)
        f = torch.baddbmm(rest.unsqueeze(1), alpha.unsqueeze(1), summaries).squeeze(1)
        f = nn.functional.leaky_relu(f, 0.2, inplace=True)
        kappa, xi = self.gnn(torch.stack((f, h)), edge, fixed, scratch).flatten(1, 2).unbind(0)
        split = kappa.split([2 * self.hidden, self.hidden], dim=1)
        return gru_step(split, xi, h, self.hidden)
