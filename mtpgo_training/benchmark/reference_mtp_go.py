# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO as one would write it first: the measure that the exported model is compared with.

Edge lists and torch_geometric's GATv2Conv, a loop over time in both coder halves, Jacobians by
torch.func, 4 x 4 matrices for the Kalman filter. All is vectorised over agents and modes; nothing
is slow on purpose. The default configuration only.
"""

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn.functional import elu, leaky_relu, softplus, softsign
from torch_geometric.nn import GATv2Conv

from models.agent_frames import to_own, to_scene
from models.ekf import FLOOR, INFLATION
from models.gnn_layers import GATPlus
from models.graph_gru import GraphGRU, GraphNetwork
from models.heads import RHO_LIMIT, SIGMA_FLOOR
from models.mtp_go import MTPGO
from models.neural_ode import NeuralODE
from models.temporal_attention import presence_bias


def edge_list(scene: Tensor, present: Tensor) -> Tensor:
    """[2, E] sender and receiver: all pairs present in a scene, and everybody with itself.

    Args:
        scene: [N] to which scene each agent belongs, in order.
        present: [N].
    """
    sizes = torch.bincount(scene)
    first = sizes.cumsum(0) - sizes
    many = sizes[scene]  # neighbours of each agent, itself among them
    receiver = torch.arange(len(scene)).repeat_interleave(many)
    begin = (many.cumsum(0) - many)[receiver]
    sender = torch.arange(len(receiver)) - begin + first[scene[receiver]]
    kept = (present[sender] & present[receiver]) | (sender == receiver)
    return torch.stack((sender, receiver))[:, kept]


class PlainGNN(nn.Module):
    """GAT+ on an edge list, with the weights of one of ours."""

    def __init__(self, network: GraphNetwork):
        super().__init__()
        layer, self.kernel = cast(GATPlus, network.layers[0]), network.kernels[0]
        size = layer.score.size(1)
        self.attention = GATv2Conv(
            layer.packed.in_features, size, add_self_loops=False, edge_dim=1
        )
        with torch.no_grad():
            value, query = layer.packed.weight.chunk(2)
            of_value, of_query = layer.packed.bias.chunk(2)
            self.attention.lin_l.weight.copy_(value)
            self.attention.lin_l.bias.copy_(of_value)
            self.attention.lin_r.weight.copy_(query)
            self.attention.lin_r.bias.copy_(of_query)
            self.attention.lin_edge.weight.copy_(layer.edge.view(-1, 1))
            self.attention.att.copy_(layer.score.unsqueeze(0))
            self.attention.bias.copy_(layer.bias)
        self.centre = layer.centre

    def forward(self, x: Tensor, edges: Tensor, squared_distance: Tensor) -> Tensor:
        """[N, out] of [N, in], edges [2, E] and their squared lengths [E]."""
        weight = self.kernel(squared_distance).unsqueeze(1)
        return self.attention(x, edges, weight) + self.centre(x)


class PlainGRU(nn.Module):
    """Eq. full_gru_update."""

    def __init__(self, cell: GraphGRU):
        super().__init__()
        self.gnn_f, self.gnn_h, self.bias = PlainGNN(cell.gnn_f), PlainGNN(cell.gnn_h), cell.bias

    def forward(self, f: Tensor, h: Tensor, edges: Tensor, distance: Tensor) -> Tensor:
        """The next state [N, D]."""
        kr, kz, kh = self.gnn_f(f, edges, distance).chunk(3, dim=1)
        xr, xz, xh = self.gnn_h(h, edges, distance).chunk(3, dim=1)
        br, bz, bh = self.bias.chunk(3)
        r, z = torch.sigmoid(kr + xr + br), torch.sigmoid(kz + xz + bz)
        return (1.0 - z) * torch.tanh(kh + r * xh + bh) + z * h


class PlainMTPGO(nn.Module):
    """The same equations on the weights of a default-configured model.

    Conditioning (frames and scaling of the input) and the linear layers are the model's own.
    """

    def __init__(self, model: MTPGO):
        super().__init__()
        self.model = model
        self.config = model.config
        self.motion = cast(NeuralODE, model.motion)
        self.encoder, self.decoder = PlainGRU(model.encoder.cell), PlainGRU(model.decoder.cell)

    def rate(self, state: Tensor, u: Tensor) -> Tensor:
        """[4] time derivative of one state under the command [2]."""
        motion = self.motion
        rates = []
        for axis in range(2):
            inputs = torch.cat((state[2:] / motion.q_scale, u[axis : axis + 1] / motion.u_scale))
            hidden = elu(motion.first[axis] @ inputs + motion.first_bias[axis])
            rates.append(u[axis] + motion.last[axis] @ hidden + motion.last_bias[axis])
        return torch.cat((state[2:], torch.stack(rates)))

    def step(self, state: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """One step of RK4, twice: to be differentiated and to be used."""
        dt = self.config.dt_s
        k1 = self.rate(state, u)
        k2 = self.rate(state + 0.5 * dt * k1, u)
        k3 = self.rate(state + 0.5 * dt * k2, u)
        k4 = self.rate(state + dt * k3, u)
        following = state + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return following, following

    def noise(self, h: Tensor) -> Tensor:
        """[N, M, 2, 2] process noise."""
        head = self.model.noise
        body = elu(head.body(h))
        s1 = softplus(head.sigma_1(body)) + SIGMA_FLOOR
        s2 = softplus(head.sigma_2(body)) + SIGMA_FLOOR
        cross = RHO_LIMIT * softsign(head.rho(body)) * s1 * s2
        return torch.stack((s1 * s1, cross, cross, s2 * s2), dim=-1).unflatten(-1, (2, 2))

    @torch.no_grad()
    def forward(
        self, features: Tensor, valid: Tensor, static: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """As :meth:`MTPGO.forward`, for one scene in which everybody is present throughout."""
        scene = torch.zeros(features.size(1), dtype=torch.long)
        log_weight, mean, covariance = self.roll_out(features[0], valid[0], scene, True)
        return log_weight.unsqueeze(0), mean.unsqueeze(0), covariance.unsqueeze(0)

    def roll_out(
        self, features: Tensor, valid: Tensor, scene: Tensor, with_covariance: bool
    ) -> tuple[Tensor, Tensor, Tensor]:
        """As :meth:`MTPGO.roll_out`, for the agents of many scenes in a row.

        Args:
            features: [N, T, F].
            valid: [N, T].
            scene: [N] to which scene each agent belongs.
            with_covariance: false saves the Jacobians and covariances, which come back empty.
        """
        model, dt = self.model, self.config.dt_s
        given = torch.where(valid.unsqueeze(-1), features, 0.0).unsqueeze(0)
        start = model.condition.start(given, valid.unsqueeze(0))
        inputs = model.condition(given, valid.unsqueeze(0), start)[0]  # [N, T, .]
        position = given[0, :, :, :2]
        agents, modes = inputs.size(0), self.config.modes
        graphs = [edge_list(scene, here) for here in valid.unbind(1)]
        lengths = [
            (position[edges[0], i] - position[edges[1], i]).square().sum(-1)
            for i, edges in enumerate(graphs)
        ]

        h = model.encoder.initial.expand(agents, -1)
        encoded = []
        for i, edges in enumerate(graphs):
            following = self.encoder(inputs[:, i], h, edges, lengths[i])
            h = torch.where(valid[:, i, None], following, h)
            encoded.append(h)
        memory = torch.stack(encoded, dim=1)  # [N, T, D]
        log_weight = model.mixture(h)

        origin, direction, velocity = start.origin[0], start.direction[0], start.velocity[0]
        state = torch.cat((start.position[0], velocity), dim=-1)
        state = state.unsqueeze(1).expand(-1, modes, -1)
        std = softplus(model.initial_covariance.head(h)) + SIGMA_FLOOR
        p = torch.diag_embed(std * std).unsqueeze(1).expand(-1, modes, -1, -1)
        g = torch.cat((0.5 * dt * dt * torch.eye(2), dt * torch.eye(2)))  # [4, 2]
        jacobian = torch.func.vmap(torch.func.jacrev(self.step, has_aux=True))
        move = torch.func.vmap(self.step)
        decoder = model.decoder
        bias = presence_bias(valid)
        h = h + decoder.initial
        means, covariances = [], []
        for k in range(self.config.horizon_steps):
            seen = model.condition.scale_states(state.unsqueeze(0), start, k)[0]
            embedded = decoder.embed(seen)
            score = decoder.attention.score(torch.cat((h, embedded), dim=1))
            alpha = torch.softmax(score + bias, dim=1)
            summary = torch.einsum("nt,ntd->nd", alpha, memory)
            f = leaky_relu(decoder.combine(torch.cat((summary, embedded), dim=1)), 0.2)
            h = self.decoder(f, h, graphs[-1], lengths[-1])
            u = model.control(h.unsqueeze(0))[0]
            if not with_covariance:
                state = move(state.reshape(-1, 4), u.reshape(-1, 2))[0].view(agents, modes, 4)
                means.append(state)
                continue
            jac, following = jacobian(state.reshape(-1, 4), u.reshape(-1, 2))
            state = following.view(agents, modes, 4)
            jac = jac.view(agents, modes, 4, 4)
            p = jac @ p @ jac.transpose(-1, -2) + g @ self.noise(h) @ g.t()
            p = p + INFLATION * torch.diag_embed(p.diagonal(dim1=-2, dim2=-1))
            means.append(state)
            covariances.append(p)
        mean = torch.stack(means, dim=2)

        # To the scene frame.
        turn = direction[:, None, None].expand(-1, modes, mean.size(2), -1)
        place = to_scene(mean[..., :2], turn) + origin[:, None, None]
        mean = torch.cat((place, to_scene(mean[..., 2:], turn)), dim=-1)
        if not with_covariance:
            return log_weight, mean, mean.new_empty(0)
        covariance = torch.stack(covariances, dim=2)
        axes = to_own(torch.eye(2).expand(agents, 2, 2), direction.unsqueeze(1))
        whole = torch.zeros(agents, 1, 1, 4, 4)
        whole[:, 0, 0, :2, :2] = whole[:, 0, 0, 2:, 2:] = axes
        covariance = whole @ covariance @ whole.transpose(-1, -2)
        share = covariance.diagonal(dim1=-2, dim2=-1).unflatten(-1, (2, 2)).mean(-1, keepdim=True)
        covariance = covariance + FLOOR * torch.diag_embed(
            share.expand(*share.shape[:-1], 2).flatten(-2)
        )
        covariance = self.config.covariance_scale * (covariance + model.observation)
        return log_weight, mean, covariance
