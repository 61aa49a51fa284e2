# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Made-up traffic on arcs as training batches, to measure the speed of training steps."""

from __future__ import annotations

import torch
from torch import nn
from torch_geometric.data import Batch, Data

from models.network_config import NetworkConfig


def arc_batch(scenes: int, config: NetworkConfig, seed: int = 0) -> Batch:
    """Return graphs of 2 to 16 agents on arcs; some enter late, and some futures end early.

    Args:
        scenes: number of graphs.
        config: of the network, for the sizes of its input.
        seed: of the traffic.
    """
    draw = torch.Generator().manual_seed(seed)
    past, ahead = config.history_steps, config.horizon_steps
    time_s = config.dt_s * torch.arange(1 - past, ahead + 1)
    graphs = []
    for _ in range(scenes):
        n = int(torch.randint(2, 17, (), generator=draw))
        turning = 0.05 * torch.randn(n, 1, generator=draw)
        angle = 6.3 * torch.rand(n, 1, generator=draw) + turning * time_s
        speed = 5.0 + 10.0 * torch.rand(n, 1, 1, generator=draw)
        velocity = speed * torch.stack((angle.cos(), angle.sin()), dim=-1)
        place = 30.0 * torch.randn(n, 1, 2, generator=draw)
        position = place + torch.cumsum(velocity * config.dt_s, dim=1)
        late = torch.rand(n, 1, generator=draw) < 0.2
        first = torch.where(late, torch.randint(past, (n, 1), generator=draw), 0)
        early = torch.rand(n, 1, generator=draw) < 0.2
        last = torch.where(early, torch.randint(1, ahead, (n, 1), generator=draw), ahead)
        valid = torch.arange(past) >= first
        weight = (torch.arange(ahead) < last).float()
        x = torch.zeros(n, past, config.feature_size)
        x[..., :2], x[..., 2:4] = position[:, :past], velocity[:, :past]
        x[..., 4:6] = torch.randn(n, past, 2, generator=draw)
        x[..., 6:8] = velocity[:, :past] / speed
        target = torch.cat((position[:, past:], velocity[:, past:]), dim=-1)
        graphs.append(
            Data(
                x=x * valid.unsqueeze(-1),
                valid=valid,
                static=nn.functional.one_hot(torch.zeros(n).long(), config.static_size).float(),
                target=target * weight.unsqueeze(-1),
                weight=weight,
                num_nodes=n,
            )
        )
    return Batch.from_data_list(graphs)
