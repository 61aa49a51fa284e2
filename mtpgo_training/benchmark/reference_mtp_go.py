# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO written directly from the paper's equations, the reference of tests and benchmarks.

It takes its weights by name from a state dict and shares only the configuration with ``models``.
Edge lists and torch_geometric's layers, a loop over time in encoder and decoder, Jacobians by
torch.func, whole matrices for the Kalman filter. It is vectorised over agents and modes, so that
the comparison is fair. Equation numbers are the paper's, constants are the model's.
"""

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn.functional import elu, leaky_relu, linear, softplus, softsign
from torch_geometric.nn import GATv2Conv, GCNConv, GraphConv
from torch_geometric.utils import softmax

from models.mtp_go_config import ModelConfig

Weights = Mapping[str, Tensor]

TABLEAUS = {
    "euler": ([0.0], [1.0]),
    "heun": ([0.0, 1.0], [0.5, 0.5]),
    "rk4": ([0.0, 0.5, 0.5, 1.0], [1 / 6, 2 / 6, 2 / 6, 1 / 6]),
}
"""Nodes and weights of the Runge-Kutta methods."""


def edge_list(scene: Tensor, present: Tensor) -> Tensor:
    """Return sender and receiver [2, E]: all pairs present in a scene, and all self-loops.

    Args:
        scene: [N] scene of each agent, ascending.
        present: [N] whether the agent is present.
    """
    sizes = torch.bincount(scene)
    first = sizes.cumsum(0) - sizes
    many = sizes[scene]  # neighbours of each agent, including itself
    receiver = torch.arange(len(scene)).repeat_interleave(many)
    begin = (many.cumsum(0) - many)[receiver]
    sender = torch.arange(len(receiver)) - begin + first[scene[receiver]]
    kept = (present[sender] & present[receiver]) | (sender == receiver)
    return torch.stack((sender, receiver))[:, kept]


class ReferenceGNN:
    """A stack of GraphConv, GCN, GAT or GAT+ layers, eq. (8) to (12), on an edge list.

    The edge weights are Gaussian kernels of the distance, eq. (13).

    Args:
        config: the model's options.
        weights: the model's, by name.
        name: of the GNN in ``weights``.
        edges: false for linear layers without neighbours (ablation).
    """

    def __init__(self, config: ModelConfig, weights: Weights, name: str, edges: bool):
        self.config, self.w, self.name = config, weights, name
        self.kind = config.layer if edges else "none"
        self.layers = [self.make(f"{name}.layers.{k}") for k in range(config.gnn_layers)]

    def make(self, name: str) -> nn.Module | None:
        """Return torch_geometric's layer, without its weights (see :meth:`bind`), or None."""
        if self.kind == "graphconv":
            size_out, size_in = self.w[f"{name}.centre.weight"].shape
            return GraphConv(size_in, size_out, aggr="mean")
        if self.kind == "gcn":
            size_out, size_in = self.w[f"{name}.linear.weight"].shape
            return GCNConv(size_in, size_out)
        if self.kind == "none" or not self.config.tied:
            return None
        heads, size_out = self.w[f"{name}.score"].shape
        size_in = self.w[f"{name}.packed.weight"].size(1)
        return GATv2Conv(size_in, size_out, heads, concat=False, add_self_loops=False, edge_dim=1)

    def bind(self) -> None:
        """Give torch_geometric's layers the current weights, so that gradients reach them."""
        for k, layer in enumerate(self.layers):
            own = {
                key.removeprefix(f"{self.name}.layers.{k}."): value
                for key, value in self.w.items()
                if key.startswith(f"{self.name}.layers.{k}.")
            }
            if self.kind == "graphconv":
                names = {
                    "lin_rel.weight": own["neighbour.weight"],
                    "lin_rel.bias": own["centre.bias"],
                    "lin_root.weight": own["centre.weight"],
                }
            elif self.kind == "gcn":
                names = {"lin.weight": own["linear.weight"], "bias": own["linear.bias"]}
            elif layer is not None:
                value, query = own["packed.weight"].chunk(2)
                of_value, of_query = own["packed.bias"].chunk(2)
                names = {
                    "lin_l.weight": value,
                    "lin_l.bias": of_value,
                    "lin_r.weight": query,
                    "lin_r.bias": of_query,
                    "lin_edge.weight": own["edge"].view(-1, 1),
                    "att": own["score"].unsqueeze(0),
                    "bias": own["bias"],
                }
            else:
                continue
            for key, tensor in names.items():
                path, _, leaf = key.rpartition(".")
                module = layer.get_submodule(path)  # type: ignore[union-attr]
                module._parameters.pop(leaf, None)
                setattr(module, leaf, tensor)

    def __call__(self, x: Tensor, edges: Tensor, squared_distance: Tensor) -> Tensor:
        """Return [N, out] of [N, in], edges [2, E] and their squared lengths [E] (m^2)."""
        if self.kind in ("graphconv", "gcn"):  # without self-loops, which GCN adds itself
            other = edges[0] != edges[1]
            edges, squared_distance = edges[:, other], squared_distance[other]
        for k, layer in enumerate(self.layers):
            name = f"{self.name}.layers.{k}"
            x = elu(x) if k else x
            if self.kind == "none":
                x = linear(x, self.w[f"{name}.linear.weight"], self.w[f"{name}.linear.bias"])
                continue
            bandwidth = self.w[f"{self.name}.kernels.{k}.log_bandwidth"].exp()
            weight = torch.exp(-squared_distance / bandwidth.square())
            if self.kind in ("graphconv", "gcn"):
                x = layer(x, edges, weight)  # type: ignore[misc]
                continue
            if layer is not None:
                out = layer(x, edges, weight.unsqueeze(1))
            else:
                out = self.untied_attention(name, x, edges, weight)
            x = out + linear(x, self.w[f"{name}.centre.weight"]) if self.kind == "gat+" else out
        return x

    def untied_attention(self, name: str, x: Tensor, edges: Tensor, weight: Tensor) -> Tensor:
        """Return the GAT layer's output, eq. (11), with different matrices for value and key."""
        sender, receiver = edges
        packed = linear(x, self.w[f"{name}.packed.weight"], self.w[f"{name}.packed.bias"])
        heads, size = self.w[f"{name}.score"].shape
        value, query, key = packed.view(len(x), 3, heads, size).unbind(1)
        z = query[receiver] + key[sender] + weight[:, None, None] * self.w[f"{name}.edge"]
        energy = (leaky_relu(z, 0.2) * self.w[f"{name}.score"]).sum(-1)  # eq. (10), logits
        alpha = softmax(energy, receiver, num_nodes=len(x)).unsqueeze(-1)
        out = torch.zeros_like(value).index_add(0, receiver, alpha * value[sender])
        return out.mean(1) + self.w[f"{name}.bias"]


class ReferenceMotion:
    """The neural ODE of one state of one agent, eq. (17) to (19), and its Runge-Kutta step.

    Args:
        config: the model's options.
        weights: the model's, by name.
    """

    def __init__(self, config: ModelConfig, weights: Weights):
        self.config, self.w = config, weights
        self.scales = (50.0, 10.0) if config.order == 1 else (10.0, 1.0)  # of q, of u

    def rate(self, state: Tensor, u: Tensor, static: Tensor) -> Tensor:
        """Return [S] the time derivative of a state [S] with the input [2] and the class [C]."""
        w, (q_scale, u_scale) = self.w, self.scales
        rates = []
        for axis in range(2):
            inputs = [state[-2:] / q_scale, u[axis : axis + 1] / u_scale]
            if self.config.static_features:
                inputs.append(static)
            y = elu(w["motion.first"][axis] @ torch.cat(inputs) + w["motion.first_bias"][axis])
            for k in range(self.config.ode_layers - 1):
                y = elu(w["motion.inner"][k, axis] @ y + w["motion.inner_bias"][k, axis])
            rates.append(u[axis] + w["motion.last"][axis] @ y + w["motion.last_bias"][axis])
        rate = torch.stack(rates)
        return rate if self.config.order == 1 else torch.cat((state[2:], rate))

    def step(self, state: Tensor, u: Tensor, static: Tensor) -> Tensor:
        """Return [S] the state one step later."""
        k = total = torch.zeros_like(state)
        for node, weight in zip(*TABLEAUS[self.config.integrator], strict=True):
            reached = state + self.config.dt_s * node * k if node else state
            k = self.rate(reached, u, static)
            total = total + weight * k
        return state + self.config.dt_s * total


class ReferenceMTPGO(nn.Module):
    """The paper's model with the weights of a :class:`models.mtp_go.MTPGO`.

    Args:
        config: the model's options.
        state: the model's state dict; the weights are copied.
    """

    def __init__(self, config: ModelConfig, state: Weights):
        super().__init__()
        self.config = config
        self.w = {name: nn.Parameter(value.detach().clone()) for name, value in state.items()}
        for name, parameter in self.w.items():
            parameter.requires_grad_(not name.startswith(("condition.", "initial_covariance.std")))
            self.register_parameter(name.replace(".", "/"), parameter)
        self.motion = ReferenceMotion(config, self.w)
        self.gnn = {
            f"{half}.{gnn}": ReferenceGNN(config, self.w, f"{half}.cell.{gnn}", edges)
            for half, edges in (("encoder", config.encoder_gnn), ("decoder", config.decoder_gnn))
            for gnn in ("gnn_f", "gnn_h")
        }

    def linear(self, name: str, x: Tensor) -> Tensor:
        """Return W x + b of the linear layer with this name."""
        return linear(x, self.w[f"{name}.weight"], self.w[f"{name}.bias"])

    @torch.no_grad()
    def forward(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial: Tensor | None = None,
        teacher: Tensor | None = None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return what ``MTPGO.forward`` returns; results of absent agents have no meaning.

        Args:
            features: [B, N, T, F].
            valid: [B, N, T].
            static: [B, N, C].
            initial: [B, N, S, S] P_0 in the scene frame.
            teacher: [B, N, H, S] true states in the scene frame that the decoder sees.
            trails: [B, N, R, H, 3].
        """
        batch, agents = valid.shape[:2]
        scene = torch.arange(batch).repeat_interleave(agents)
        results = self.roll_out(
            features.flatten(0, 1),
            valid.flatten(0, 1),
            static.flatten(0, 1),
            scene,
            True,
            None if initial is None else initial.flatten(0, 1),
            None if teacher is None else teacher.flatten(0, 1),
            None if trails is None else trails.flatten(0, 1),
        )
        log_weight, mean, covariance = results
        origin, turn, start, velocity = self.frames(features.flatten(0, 1), valid.flatten(0, 1))
        speed = velocity.norm(dim=-1)
        place = origin + torch.einsum("nij,nj->ni", turn, start)
        mean = self.with_settled(mean, place, torch.einsum("nij,nj->ni", turn, velocity), speed)
        log_weight = self.with_stay_bias(log_weight, mean, place, speed)
        mean = self.with_local_mean(log_weight, mean, covariance, speed, static.flatten(0, 1))
        log_weight, mean, covariance = (
            x.unflatten(0, (batch, agents)) for x in (log_weight, mean, covariance)
        )
        return log_weight, mean, covariance

    def roll_out(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        scene: Tensor,
        with_covariance: bool,
        initial: Tensor | None = None,
        teacher: Tensor | None = None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return log weights [N, M], means [N, M, H, S] and covariances [N, M, H, S, S].

        Args:
            features: [N, T, F] of the agents of many scenes in a row.
            valid: [N, T].
            static: [N, C].
            scene: [N] to which scene each agent belongs.
            with_covariance: false saves Jacobians and covariances, which come back empty.
            initial: [N, S, S] P_0 in the scene frame.
            teacher: [N, H, S] true states in the scene frame that the decoder sees.
            trails: [N, R, H, 3], if the network has them.
        """
        c = self.config
        for gnn in self.gnn.values():
            gnn.bind()
        features = torch.where(valid.unsqueeze(-1), features, 0.0)
        origin, turn, start, velocity = self.frames(features, valid)
        graphs = []
        for i, present in enumerate(valid.unbind(1)):
            edges = edge_list(scene, present)
            offset = features[edges[0], i, :2] - features[edges[1], i, :2]
            graphs.append((edges, offset.square().sum(-1)))

        # Encoder.
        inputs = self.encoder_inputs(features, valid, origin, turn, velocity)
        if c.static_features and c.static_inputs == "all":
            repeated = static.unsqueeze(1).expand(-1, inputs.size(1), -1)
            inputs = torch.cat((inputs, repeated), dim=-1)
        h = self.w["encoder.initial"].expand(len(valid), -1)
        encoded = []
        for i, graph in enumerate(graphs):
            following = self.graph_gru("encoder", inputs[:, i], h, graph)
            h = torch.where(valid[:, i, None], following, h)
            encoded.append(h)
        history = torch.stack(encoded, dim=1)  # [N, T, D]
        along: Tensor | None = None
        if c.trail_branches:
            assert trails is not None
            along, summary = self.trail_inputs(trails)
            h = h + summary
        log_weight = torch.log_softmax(self.linear("mixture.out", elu(h)), dim=-1)

        # Decoder, motion model and Kalman filter.
        state = torch.cat((start, velocity), dim=-1)[:, : c.state_size]
        state = state.unsqueeze(1).expand(-1, c.modes, -1)  # [N, M, S]
        p = self.first_covariance(h, turn, initial).unsqueeze(1).expand(-1, c.modes, -1, -1)
        classes = static.repeat_interleave(c.modes, dim=0)
        h = h + self.w["decoder.initial"]
        means, covariances = [], []
        jacobian: Tensor | None = None
        for k in range(c.horizon_steps):
            seen = state
            if k > 0 and teacher is not None:
                seen = self.into_frames(teacher[:, k - 1], origin, turn).unsqueeze(1)
                seen = seen.expand_as(state)
            trail = None if along is None else along[:, k]
            x = self.decoder_input(h, seen, start, velocity, k, history, valid, trail)
            h = self.graph_gru("decoder", x, h, graphs[-1])
            control = self.linear("control.out", elu(self.linear("control.body", h)))
            control = control.view(len(h), c.modes, -1)
            if c.ode:
                u = control + velocity.unsqueeze(1) if c.order == 1 else control
                state, jacobian = self.move(state, u, classes, with_covariance and c.ekf)
            else:
                uniform = torch.cat((start + velocity * (k + 1) * c.dt_s, velocity), dim=-1)
                state = uniform[:, None, : c.state_size] + control
            means.append(state)
            if with_covariance:
                q = self.process_noise(h)
                p = self.kalman(p, jacobian, q) if c.ekf else self.direct_covariance(q, k + 1)
                covariances.append(p)

        path = torch.stack(means, dim=2)
        if c.hold_standing:
            path = self.held(path, start, velocity)
        mean = self.into_scene(path, origin, turn)
        if not with_covariance:
            return log_weight, mean, mean.new_empty(0)
        return log_weight, mean, self.output_covariance(torch.stack(covariances, dim=2), turn)

    # Each agent's own frame.

    def frames(self, features: Tensor, valid: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return origin [N, 2], rotation into the scene [N, 2, 2], and start in the frame.

        The start is position and velocity, [N, 2] each, at the last sample of each agent. The
        frame's heading is the velocity's from 1 m/s on and the yaw below 0.5 m/s.
        """
        steps = torch.arange(valid.size(1))
        last = features[torch.arange(len(valid)), (steps * valid).amax(1)]
        position, velocity, yaw = last[:, :2], last[:, 2:4], last[:, 6:8]
        zero = torch.zeros_like(position)
        if not self.config.agent_frame:
            turn = torch.eye(2, dtype=features.dtype).expand(len(valid), 2, 2)
            return zero, turn, position, velocity
        speed = velocity.norm(dim=-1, keepdim=True)
        share = (2.0 * speed - 1.0).clamp(0.0, 1.0)
        heading = share * velocity / speed.clamp(min=0.5) + (1.0 - share) * yaw
        cos, sin = (heading / heading.norm(dim=-1, keepdim=True)).unbind(-1)
        turn = torch.stack((cos, -sin, sin, cos), dim=-1).view(-1, 2, 2)
        return position, turn, zero, torch.einsum("nji,nj->ni", turn, velocity)

    def encoder_inputs(
        self, features: Tensor, valid: Tensor, origin: Tensor, turn: Tensor, velocity: Tensor
    ) -> Tensor:
        """Return [N, T, .] scaled features, with the motion in each agent's own frame."""
        if self.config.agent_frame:
            steps = torch.arange(valid.size(1))
            since = (steps - (steps * valid).amax(1, keepdim=True)).to(features.dtype)
            own = [
                torch.einsum("nji,ntj->nti", turn, vector)
                for vector in (
                    features[..., :2] - origin.unsqueeze(1),
                    features[..., 2:4],
                    features[..., 4:6],
                    features[..., 6:8],
                )
            ]
            uniform = velocity.unsqueeze(1) * (since * self.config.dt_s).unsqueeze(-1)
            parts = features, own[0] - uniform, own[1], own[1] - velocity.unsqueeze(1), *own[2:]
            features = torch.cat(parts, dim=-1)
        return (features - self.w["condition.input_mean"]) / self.w["condition.input_std"]

    def into_frames(self, state: Tensor, origin: Tensor, turn: Tensor) -> Tensor:
        """Return [N, S] states of the scene frame in the agents' frames."""
        position = torch.einsum("nji,nj->ni", turn, state[:, :2] - origin)
        if self.config.order == 1:
            return position
        return torch.cat((position, torch.einsum("nji,nj->ni", turn, state[:, 2:])), dim=-1)

    def into_scene(self, states: Tensor, origin: Tensor, turn: Tensor) -> Tensor:
        """Return [N, M, H, S] states of the agents' frames in the scene frame."""
        turned = [torch.einsum("nij,nmhj->nmhi", turn, part) for part in states.split(2, dim=-1)]
        turned[0] = turned[0] + origin[:, None, None]
        return torch.cat(turned, dim=-1)

    # Encoder and decoder.

    def graph_gru(self, half: str, f: Tensor, h: Tensor, graph: tuple[Tensor, Tensor]) -> Tensor:
        """Return the next hidden state [N, D] (graph GRU, eq. 6 and 7)."""
        kr, kz, kh = self.gnn[f"{half}.gnn_f"](f, *graph).chunk(3, dim=1)
        xr, xz, xh = self.gnn[f"{half}.gnn_h"](h, *graph).chunk(3, dim=1)
        br, bz, bh = self.w[f"{half}.cell.bias"].chunk(3)
        r, z = torch.sigmoid(kr + xr + br), torch.sigmoid(kz + xz + bz)
        return (1.0 - z) * torch.tanh(kh + r * xh + bh) + z * h

    def decoder_input(
        self,
        h: Tensor,
        states: Tensor,
        start: Tensor,
        velocity: Tensor,
        step: int,
        history: Tensor,
        valid: Tensor,
        trail: Tensor | None,
    ) -> Tensor:
        """Return the GRU input f [N, D], eq. (16), with temporal attention, eq. (14) and (15)."""
        if self.config.agent_frame:  # how far each state is from uniform motion
            uniform = torch.cat((start + velocity * step * self.config.dt_s, velocity), dim=-1)
            states = states - uniform[:, None, : states.size(-1)]
        x = (states - self.w["condition.state_mean"]) / self.w["condition.state_std"]
        embedded = self.linear("decoder.embed", x.flatten(1))
        if trail is not None:
            embedded = embedded + trail
        score = self.linear("decoder.attention.score", torch.cat((h, embedded), dim=1))
        alpha = torch.softmax(score.masked_fill(~valid, float("-inf")), dim=1)
        summary = torch.einsum("nt,ntd->nd", alpha, history)
        return leaky_relu(self.linear("decoder.combine", torch.cat((summary, embedded), 1)), 0.2)

    def trail_inputs(self, trails: Tensor) -> tuple[Tensor, Tensor]:
        """Return embedded trails [N, H, D] and their summary [N, D] of trails [N, R, H, 3].

        Not in the paper: place, velocity and share of each path, in the decoder's scales.
        """
        place, share = trails[..., :2].clamp(-40.0, 40.0), trails[..., 2:]
        velocity = torch.diff(place, dim=2, prepend=torch.zeros_like(place[:, :, :1]))
        velocity = torch.where(share > 0.0, velocity / self.config.dt_s, 0.0)
        scale = torch.tensor([5.0, 2.0, 3.0, 1.0, 1.0], dtype=trails.dtype)
        columns = torch.cat((place, velocity, share), dim=-1) / scale  # [N, R, H, 5]
        each = linear(columns.transpose(1, 2).flatten(2), self.w["trail.embed.weight"])
        every = max(1, self.config.horizon_steps // 5)
        some = columns[:, :, every - 1 :: every].flatten(1)
        return each, self.linear("trail.out", elu(self.linear("trail.body", some)))

    # Motion and covariance.

    def with_settled(self, mean: Tensor, place: Tensor, velocity: Tensor, speed: Tensor) -> Tensor:
        """Return [N, M, H, S] means, those in which standing agents hardly move settled.

        Not in the paper. A mode that ends d metres from where uniform motion ends comes nearer to
        it by the share exp(-2 d^2).
        """
        if not self.config.settle_standing:
            return mean
        time = self.config.dt_s * torch.arange(1, mean.shape[2] + 1, dtype=mean.dtype)
        path = place.unsqueeze(1) + velocity.unsqueeze(1) * time.view(1, -1, 1)
        uniform = torch.cat((path, velocity.unsqueeze(1).expand_as(path)), dim=-1)
        uniform = uniform[:, None, :, : mean.shape[-1]]
        standing = ((0.5 - speed) / 0.2).clamp(0.0, 1.0).unsqueeze(1)
        squared = (mean - uniform)[:, :, -1, :2].square().sum(dim=-1)
        share = (standing * torch.exp(-2.0 * squared))[:, :, None, None]
        return share * uniform + (1.0 - share) * mean

    def with_stay_bias(
        self, log_weight: Tensor, mean: Tensor, place: Tensor, speed: Tensor
    ) -> Tensor:
        """Return [N, M] log weights with which standing agents are likelier to stay.

        Not in the paper. Of a mode that ends d metres from the place of an agent up to 0.3 m/s,
        the logarithm grows by the bias times exp(-2 d^2).
        """
        squared = (mean[:, :, -1, :2] - place.unsqueeze(1)).square().sum(dim=-1)
        standing = ((0.5 - speed) / 0.2).clamp(0.0, 1.0).unsqueeze(1)
        bias = self.config.stay_bias * standing * torch.exp(-2.0 * squared)
        weight = torch.exp(log_weight + bias)
        return torch.log(weight / weight.sum(dim=-1, keepdim=True))

    def with_local_mean(
        self, log_weight: Tensor, mean: Tensor, covariance: Tensor, speed: Tensor, static: Tensor
    ) -> Tensor:
        """Return [N, M, H, S] means, the heaviest of moving agents moved among its neighbours.

        Not in the paper. The neighbours are weighted by a Gaussian at the end of the horizon.
        """
        moved = mean.clone()
        for n, heaviest in enumerate(log_weight.argmax(dim=-1).tolist()):
            kernel = sum(
                k * float(x) for k, x in zip(self.config.heaviest_kernels, static[n], strict=False)
            )
            if kernel == 0.0:
                continue
            offset = mean[n, :, -1, :2] - mean[n, heaviest, -1, :2]
            inverse = torch.linalg.inv(covariance[n, heaviest, -1, :2, :2])
            squared = torch.einsum("mi,ij,mj->m", offset, inverse, offset)
            near = log_weight[n].exp() * torch.exp(-0.5 * squared / kernel**2)
            local = torch.einsum("m,mhs->hs", near / near.sum(), mean[n])
            share = ((speed[n] - 0.3) / 0.2).clamp(0.0, 1.0)
            moved[n, heaviest] = share * local + (1.0 - share) * mean[n, heaviest]
        return moved

    def held(self, path: Tensor, start: Tensor, velocity: Tensor) -> Tensor:
        """Return [N, M, H, S] paths, the first of standing agents in uniform motion.

        Not in the paper. Below 0.3 m/s an agent stands, from 0.5 m/s on it moves.
        """
        time = self.config.dt_s * torch.arange(1, path.size(2) + 1, dtype=path.dtype)
        moved = start.unsqueeze(1) + velocity.unsqueeze(1) * time.unsqueeze(1)
        uniform = torch.cat((moved, velocity.unsqueeze(1).expand_as(moved)), dim=-1)
        uniform = uniform[..., : path.size(-1)]
        share = ((velocity.norm(dim=-1) - 0.3) / 0.2).clamp(0.0, 1.0)[:, None, None]
        first = share * path[:, 0] + (1.0 - share) * uniform
        return torch.cat((first.unsqueeze(1), path[:, 1:]), dim=1)

    def move(
        self, state: Tensor, u: Tensor, classes: Tensor, with_jacobian: bool
    ) -> tuple[Tensor, Tensor | None]:
        """Return the next states [N, M, S], eq. (21a), and Jacobians F [N, M, S, S], eq. (22)."""
        arguments = state.flatten(0, 1), u.flatten(0, 1), classes
        if not with_jacobian:
            return torch.func.vmap(self.motion.step)(*arguments).view(state.shape), None

        def twice(*of_one: Tensor) -> tuple[Tensor, Tensor]:
            """Return the step twice: to be differentiated, and as a value."""
            following = self.motion.step(*of_one)
            return following, following

        derivative = torch.func.jacrev(twice, has_aux=True)
        jacobian, following = torch.func.vmap(derivative)(*arguments)
        return following.view(state.shape), jacobian.unflatten(0, state.shape[:2])

    def process_noise(self, h: Tensor) -> Tensor:
        """Return the process noise Q [N, M, 2, 2], eq. (23)."""
        body = elu(self.linear("noise.body", h))
        s1 = softplus(self.linear("noise.sigma_1", body)) + 0.01
        s2 = softplus(self.linear("noise.sigma_2", body)) + 0.01
        cross = 0.999 * softsign(self.linear("noise.rho", body)) * s1 * s2
        return torch.stack((s1 * s1, cross, cross, s2 * s2), dim=-1).unflatten(-1, (2, 2))

    def first_covariance(self, h: Tensor, turn: Tensor, initial: Tensor | None) -> Tensor:
        """Return P_0 [N, S, S]: given, learned or configured."""
        if initial is not None:
            whole = self.block_diagonal(turn)
            return whole.transpose(-1, -2) @ initial @ whole
        if self.config.ekf and self.config.initial_covariance == "learned":
            std = softplus(self.linear("initial_covariance.head", h)) + 0.01
        else:
            std = self.w["initial_covariance.std"].expand(len(h), -1)
        return torch.diag_embed(std * std)

    def kalman(self, p: Tensor, jacobian: Tensor | None, q: Tensor) -> Tensor:
        """Return P' = F P F^T + G Q G^T (EKF time update, eq. 21b), variances raised by 1e-5."""
        assert jacobian is not None
        dt, eye = self.config.dt_s, torch.eye(2, dtype=p.dtype)
        g = dt * eye
        if self.config.order == 2:
            upper = 0.0 if self.config.noise_input == "velocity" else 0.5 * dt * dt
            g = torch.cat((upper * eye, g))  # constant G, eq. (25)
        p = jacobian @ p @ jacobian.transpose(-1, -2) + g @ q @ g.t()
        return p + 1e-5 * torch.diag_embed(p.diagonal(dim1=-2, dim2=-1))

    def direct_covariance(self, q: Tensor, steps: int) -> Tensor:
        """Return the decoder's own covariance [N, M, S, S], ``steps`` ahead (ablation)."""
        size = self.config.state_size
        p = q.new_zeros(*q.shape[:2], 4, 4)
        p[..., :2, :2], p[..., 2:, 2:] = (steps * self.config.dt_s) ** 2 * q, q
        return p[..., :size, :size]

    def block_diagonal(self, turn: Tensor) -> Tensor:
        """Return [N, S, S] rotations of whole states."""
        whole = turn.new_zeros(len(turn), 4, 4)
        whole[:, :2, :2] = whole[:, 2:, 2:] = turn
        return whole[:, : self.config.state_size, : self.config.state_size]

    def output_covariance(self, p: Tensor, turn: Tensor) -> Tensor:
        """Return [N, M, H, S, S] in the scene frame, of observed states, calibrated.

        Each 2x2 block's diagonal is raised by 1e-6 of its mean variance.
        """
        whole = self.block_diagonal(turn)[:, None, None]
        p = whole @ p @ whole.transpose(-1, -2)
        share = p.diagonal(dim1=-2, dim2=-1).unflatten(-1, (-1, 2)).mean(-1, keepdim=True)
        p = p + 1e-6 * torch.diag_embed(share.expand(*share.shape[:-1], 2).flatten(-2))
        observation = torch.tensor(self.config.observation_std).square().diag().to(p.dtype)
        return self.config.covariance_scale * (p + observation)
