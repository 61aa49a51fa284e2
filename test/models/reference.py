# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A second MTP-GO, written for obviousness: one scene, loops, edge lists, PyG layers, torch.func.

It reads a model's state dict by name and follows the paper's equations step by step in float64.
It shares no code with ``models`` but the configuration. Only agents present at t get a result.
"""

import math

import torch
from torch import Tensor
from torch.nn.functional import elu, leaky_relu, softplus, softsign
from torch_geometric.nn import GATv2Conv, GCNConv, GraphConv

from models.mtp_go_config import ModelConfig

NODES = {"euler": [0.0], "heun": [0.0, 1.0], "rk4": [0.0, 0.5, 0.5, 1.0]}
WEIGHTS = {"euler": [1.0], "heun": [0.5, 0.5], "rk4": [1 / 6, 2 / 6, 2 / 6, 1 / 6]}


def rotation(direction: Tensor) -> Tensor:
    """[2, 2] matrix that takes a vector from the frame with this heading into the scene."""
    c, s = float(direction[0]), float(direction[1])
    return torch.tensor([[c, -s], [s, c]], dtype=torch.float64)


class Reference:
    def __init__(self, config: ModelConfig, state: dict[str, Tensor]):
        self.c = config
        self.w = {name: value.detach().double() for name, value in state.items()}

    def linear(self, name: str, x: Tensor) -> Tensor:
        return self.w[f"{name}.weight"] @ x + self.w[f"{name}.bias"]

    # One GNN layer on an edge list, by torch_geometric.

    def layer(self, name: str, kind: str, x: Tensor, weight: Tensor) -> Tensor:
        """Node values [n, out] from [n, in] and kernel weights [n, n] of a complete graph."""
        n, w = len(x), self.w
        if kind == "none":
            return torch.stack([self.linear(f"{name}.linear", row) for row in x])
        loops = kind in ("gat", "gat+")
        pairs = [(j, i) for i in range(n) for j in range(n) if loops or i != j]
        edges = torch.tensor(pairs, dtype=torch.long).reshape(-1, 2).t()
        values = torch.tensor([weight[i, j] for j, i in pairs], dtype=torch.float64)
        if kind == "graphconv":
            size_out, size_in = w[f"{name}.centre.weight"].shape
            conv = GraphConv(size_in, size_out, aggr="mean").double()
            conv.lin_rel.weight.data = w[f"{name}.neighbour.weight"]
            conv.lin_rel.bias.data = w[f"{name}.centre.bias"]
            conv.lin_root.weight.data = w[f"{name}.centre.weight"]
            return conv(x, edges, values)
        if kind == "gcn":
            size_out, size_in = w[f"{name}.linear.weight"].shape
            gcn = GCNConv(size_in, size_out).double()
            gcn.lin.weight.data = w[f"{name}.linear.weight"]
            gcn.bias.data = w[f"{name}.linear.bias"]
            return gcn(x, edges, values)
        out = self.attention(name, x, edges, values)
        if kind == "gat+":
            out = out + x @ w[f"{name}.centre.weight"].t()
        return out

    def attention(self, name: str, x: Tensor, edges: Tensor, values: Tensor) -> Tensor:
        w, heads = self.w, self.c.heads
        packed, bias = w[f"{name}.packed.weight"], w[f"{name}.packed.bias"]
        size = w[f"{name}.edge"].shape[1]
        block = [slice(k * heads * size, (k + 1) * heads * size) for k in range(3)]
        if self.c.tied:
            gat = GATv2Conv(
                x.shape[1], size, heads, concat=False, add_self_loops=False, edge_dim=1
            ).double()
            gat.lin_l.weight.data, gat.lin_l.bias.data = packed[block[0]], bias[block[0]]
            gat.lin_r.weight.data, gat.lin_r.bias.data = packed[block[1]], bias[block[1]]
            gat.lin_edge.weight.data = w[f"{name}.edge"].reshape(-1, 1)
            gat.att.data = w[f"{name}.score"].unsqueeze(0)
            gat.bias.data = w[f"{name}.bias"]
            return gat(x, edges, values.unsqueeze(1))
        value, query, key = (x @ packed[b].t() + bias[b] for b in block)
        out = torch.zeros(len(x), size, dtype=torch.float64)
        pairs = edges.t().tolist()
        for head in range(heads):
            part = slice(head * size, (head + 1) * size)
            for i in range(len(x)):
                mine = [(j, e) for (j, k), e in zip(pairs, values, strict=True) if k == i]
                scores = [
                    w[f"{name}.score"][head]
                    @ leaky_relu(query[i, part] + key[j, part] + e * w[f"{name}.edge"][head], 0.2)
                    for j, e in mine
                ]
                for alpha, (j, _) in zip(torch.softmax(torch.stack(scores), 0), mine, strict=True):
                    out[i] += alpha * value[j, part] / heads
        return out + w[f"{name}.bias"]

    def gnn(self, name: str, kind: str, x: Tensor, position: Tensor) -> Tensor:
        for k in range(self.c.gnn_layers):
            bandwidth = math.exp(float(self.w[f"{name}.kernels.{k}.log_bandwidth"]))
            distance = torch.cdist(position, position)
            weight = torch.exp(-((distance / bandwidth) ** 2))
            x = self.layer(f"{name}.layers.{k}", kind, elu(x) if k else x, weight)
        return x

    def gru(self, name: str, kappa: Tensor, xi: Tensor, h: Tensor) -> Tensor:
        """Eq. full_gru_update, for all nodes of one graph."""
        kr, kz, kh = kappa.chunk(3, dim=1)
        xr, xz, xh = xi.chunk(3, dim=1)
        br, bz, bh = self.w[f"{name}.bias"].chunk(3)
        r = torch.sigmoid(kr + xr + br)
        z = torch.sigmoid(kz + xz + bz)
        candidate = torch.tanh(kh + r * xh + bh)
        return (1 - z) * candidate + z * h

    # Each agent's own frame and inputs.

    def frame(self, history: Tensor, seen: list[int]) -> tuple[Tensor, Tensor, Tensor]:
        """Origin [2], direction [2] and velocity in the frame [2] at the agent's last sample."""
        last = history[seen[-1]]
        if not self.c.agent_frame:
            return torch.zeros(2).double(), torch.tensor([1.0, 0.0]).double(), last[2:4]
        speed = float(last[2:4].norm())
        share = min(max(2 * speed - 1, 0.0), 1.0)
        direction = (1 - share) * last[6:8]
        if share > 0:
            direction = direction + share * last[2:4] / speed
        direction = direction / direction.norm()
        return last[:2], direction, rotation(direction).t() @ last[2:4]

    def encoder_input(self, history: Tensor, seen: list[int], step: int) -> Tensor:
        x = history[step]
        if self.c.agent_frame:
            origin, direction, velocity = self.frame(history, seen)
            turn = rotation(direction).t()
            since = (step - seen[-1]) * self.c.dt_s
            x = torch.cat(
                (
                    x,
                    turn @ (x[:2] - origin) - velocity * since,
                    turn @ x[2:4],
                    turn @ x[2:4] - velocity,
                    turn @ x[4:6],
                    turn @ x[6:8],
                )
            )
        return (x - self.w["condition.input_mean"]) / self.w["condition.input_std"]

    # The motion model.

    def derivative(self, state: Tensor, u: Tensor, static: Tensor) -> Tensor:
        first = self.c.order == 1
        q = state if first else state[2:]
        rates = []
        for g in range(2):
            parts = [q / (50.0 if first else 10.0), u[g : g + 1] / (10.0 if first else 1.0)]
            if self.c.static_features:
                parts.append(static)
            y = elu(self.w["motion.first"][g] @ torch.cat(parts) + self.w["motion.first_bias"][g])
            for k in range(self.c.ode_layers - 1):
                y = elu(self.w["motion.inner"][k, g] @ y + self.w["motion.inner_bias"][k, g])
            rates.append(u[g] + self.w["motion.last"][g] @ y + self.w["motion.last_bias"][g])
        rate = torch.stack(rates)
        return rate if first else torch.cat((state[2:], rate))

    def step(self, state: Tensor, u: Tensor, static: Tensor) -> Tensor:
        """One Runge-Kutta step of the whole state."""
        k = torch.zeros_like(state)
        total = torch.zeros_like(state)
        for a, b in zip(NODES[self.c.integrator], WEIGHTS[self.c.integrator], strict=True):
            k = self.derivative(state + self.c.dt_s * a * k, u, static)
            total = total + b * k
        return state + self.c.dt_s * total

    def process_noise(self, h: Tensor, mode: int) -> Tensor:
        y = elu(self.linear("noise.body", h))
        s1 = softplus(self.linear("noise.sigma_1", y)[mode]) + 0.01
        s2 = softplus(self.linear("noise.sigma_2", y)[mode]) + 0.01
        cross = 0.999 * softsign(self.linear("noise.rho", y)[mode]) * s1 * s2
        return torch.stack((torch.stack((s1 * s1, cross)), torch.stack((cross, s2 * s2))))

    def kalman(self, p: Tensor, state: Tensor, u: Tensor, static: Tensor, q: Tensor) -> Tensor:
        jacobian = torch.func.jacrev(self.step)(state, u, static)
        dt, eye = self.c.dt_s, torch.eye(2).double()
        if self.c.order == 1:
            g = dt * eye
        elif self.c.noise_input == "velocity":
            g = torch.cat((0 * eye, dt * eye))
        else:
            g = torch.cat((0.5 * dt * dt * eye, dt * eye))
        p = jacobian @ p @ jacobian.t() + g @ q @ g.t()
        return p + 1e-5 * torch.diag(p.diagonal())

    def into_scene(self, p: Tensor, turn: Tensor) -> Tensor:
        """A covariance turned into the scene, with the floor on its blocks."""
        full = torch.block_diag(*[turn] * self.c.order)
        p = full @ p @ full.t()
        for k in range(self.c.order):
            part = slice(2 * k, 2 * k + 2)
            p[part, part] += 0.5e-6 * p[part, part].trace() * torch.eye(2).double()
        return p

    # The whole.

    def encode(self, features: Tensor, valid: Tensor) -> list[list[Tensor]]:
        """States of every agent after every step, [N][T] of [D]."""
        agents, steps = valid.shape
        kind = self.c.layer if self.c.encoder_gnn else "none"
        h = [self.w["encoder.initial"] for _ in range(agents)]
        states: list[list[Tensor]] = [[] for _ in range(agents)]
        seen = [valid[a].nonzero().flatten().tolist() for a in range(agents)]
        for i in range(steps):
            here = [a for a in range(agents) if valid[a, i]]
            if here:
                x = torch.stack([self.encoder_input(features[a], seen[a], i) for a in here])
                position = features[here, i, :2]
                before = torch.stack([h[a] for a in here])
                kappa = self.gnn("encoder.cell.gnn_f", kind, x, position)
                xi = self.gnn("encoder.cell.gnn_h", kind, before, position)
                after = self.gru("encoder.cell", kappa, xi, before)
                for a, value in zip(here, after, strict=True):
                    h[a] = value
            for a in range(agents):
                states[a].append(h[a])
        return states

    def decoder_state(self, state: Tensor, start: Tensor, velocity: Tensor, k: int) -> Tensor:
        """One agent's scaled states [M * S] from [M, S]."""
        if self.c.agent_frame:
            expected = start + velocity * k * self.c.dt_s
            if self.c.order == 2:
                expected = torch.cat((expected, velocity))
            state = state - expected
        return ((state - self.w["condition.state_mean"]) / self.w["condition.state_std"]).flatten()

    def predict(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial: Tensor | None = None,
        teacher: Tensor | None = None,
    ) -> dict[int, tuple[Tensor, Tensor, Tensor]]:
        """Log weights [M], means [M, H, S] and covariances [M, H, S, S] by agent present at t.

        Args:
            features: [N, T, F], valid: [N, T], static: [N, C] of one scene.
            initial: [N, S, S] given P_0 in the scene frame.
            teacher: [N, H, S] true states in the scene frame that the decoder sees.
        """
        c = self.c
        encoded = self.encode(features, valid)
        here = [a for a in range(len(valid)) if valid[a, -1]]
        kind = c.layer if c.decoder_gnn else "none"
        frames, start, h, p0, state = {}, {}, {}, {}, {}
        for a in here:
            seen = valid[a].nonzero().flatten().tolist()
            frames[a] = self.frame(features[a], seen)
            start[a] = torch.zeros(2).double() if c.agent_frame else features[a, -1, :2]
            h[a] = encoded[a][-1] + self.w["decoder.initial"]
            first = torch.cat((start[a], frames[a][2]))[: c.state_size]
            state[a] = torch.stack([first] * c.modes)
            p0[a] = self.first_covariance(encoded[a][-1])
            if initial is not None:
                turn = torch.block_diag(*[rotation(frames[a][1])] * c.order)
                p0[a] = turn.t() @ initial[a] @ turn
        p = {a: [p0[a]] * c.modes for a in here}
        means = {a: torch.zeros(c.modes, c.horizon_steps, c.state_size).double() for a in here}
        covariances = {
            a: torch.zeros(c.modes, c.horizon_steps, c.state_size, c.state_size).double()
            for a in here
        }
        position = features[here, -1, :2]
        for k in range(c.horizon_steps):
            inputs = []
            for a in here:
                told = state[a]
                if k > 0 and teacher is not None:
                    told = self.into_frame(teacher[a, k - 1], frames[a]).expand(c.modes, -1)
                x = self.decoder_state(told, start[a], frames[a][2], k)
                embedded = self.linear("decoder.embed", x)
                score = self.linear("decoder.attention.score", torch.cat((h[a], embedded)))
                steps = [i for i in range(c.history_steps) if valid[a, i]]
                alpha = torch.softmax(torch.stack([score[i] for i in steps]), 0)
                summary = sum(
                    weight * encoded[a][i] for weight, i in zip(alpha, steps, strict=True)
                )
                combined = self.linear("decoder.combine", torch.cat((summary, embedded)))
                inputs.append(leaky_relu(combined, 0.2))
            before = torch.stack([h[a] for a in here])
            kappa = self.gnn("decoder.cell.gnn_f", kind, torch.stack(inputs), position)
            xi = self.gnn("decoder.cell.gnn_h", kind, before, position)
            after = self.gru("decoder.cell", kappa, xi, before)
            for a, hidden in zip(here, after, strict=True):
                h[a] = hidden
                control = self.linear("control.out", elu(self.linear("control.body", hidden)))
                control = control.view(c.modes, -1)
                turn = rotation(frames[a][1])
                following = []
                for m in range(c.modes):
                    q = self.process_noise(hidden, m)
                    if c.ode:
                        u = control[m] + (frames[a][2] if c.order == 1 else 0.0)
                        new = self.step(state[a][m], u, static[a])
                    else:
                        expected = start[a] + frames[a][2] * (k + 1) * c.dt_s
                        new = torch.cat((expected, frames[a][2]))[: c.state_size] + control[m]
                    if c.ekf:
                        p[a][m] = self.kalman(p[a][m], state[a][m], u, static[a], q)
                        own = p[a][m]
                    else:
                        time = (k + 1) * c.dt_s
                        own = torch.block_diag(time * time * q, q)[: c.state_size, : c.state_size]
                    covariances[a][m, k] = self.into_scene(own, turn)
                    means[a][m, k, :2] = turn @ new[:2] + (frames[a][0] if c.agent_frame else 0.0)
                    if c.order == 2:
                        means[a][m, k, 2:] = turn @ new[2:]
                    following.append(new)
                state[a] = torch.stack(following)
        result = {}
        for a in here:
            logits = self.linear("mixture.out", elu(encoded[a][-1]))
            result[a] = (torch.log_softmax(logits, 0), means[a], covariances[a])
        return result

    def first_covariance(self, h: Tensor) -> Tensor:
        if not self.c.ekf or self.c.initial_covariance == "configured":
            std = self.w["initial_covariance.std"]
        else:
            std = softplus(self.linear("initial_covariance.head", h)) + 0.01
        return torch.diag(std**2)

    def into_frame(self, state: Tensor, frame: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        turn = rotation(frame[1]).t()
        parts = [turn @ (state[:2] - frame[0])]
        if self.c.order == 2:
            parts.append(turn @ state[2:])
        return torch.cat(parts)
