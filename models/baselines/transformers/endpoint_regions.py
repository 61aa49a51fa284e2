# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Regions of the endpoints for the region-based training of mmTransformer (Sec. 3.3)."""

import torch
from torch import Tensor

STANDING_M = 1.0
"""Endpoints nearer than this to the agent's place are left out, as long as others are there (m).

Chosen: standing agents would fill whole regions with one point."""

MOST_ENDPOINTS = 2000
"""Endpoints that are clustered, evenly taken from all (chosen: a fraction of a second)."""

ROUNDS = 10
"""Rounds of the clustering (chosen: the centres hardly move any more)."""


def balanced_centres(endpoint: Tensor, regions: int) -> Tensor:
    """Return [R, 2] centres of clusters of equal size, by k-means with that constraint.

    In each round the pairs of endpoint and centre are gone through from the nearest on, and an
    endpoint joins a centre that has room.

    Args:
        endpoint: [n, 2] in the agents' own frames (m).
        regions: R.
    """
    moving = endpoint[torch.linalg.vector_norm(endpoint, dim=-1) > STANDING_M]
    points = moving if len(moving) >= regions else endpoint
    points = points[:: max(1, -(-len(points) // MOST_ENDPOINTS))]
    if len(points) < regions:
        return torch.zeros(regions, 2, dtype=endpoint.dtype, device=endpoint.device)
    # First centres: evenly along the direction of travel, the main direction of the endpoints.
    order = points[:, 0].argsort()
    places = [(2 * i + 1) * len(points) // (2 * regions) for i in range(regions)]
    centres = points[order[places]].clone()
    for _ in range(ROUNDS):
        member = _balanced_members(torch.cdist(points, centres))
        centres = torch.stack([points[member == r].mean(dim=0) for r in range(regions)])
    return centres


def _balanced_members(distance: Tensor) -> Tensor:
    """Return [n] the centre of each point, of distances [n, R]; sizes differ by one at most."""
    count, regions = distance.shape
    room = [count // regions + (r < count % regions) for r in range(regions)]
    member = [-1] * count
    for pair in distance.flatten().argsort(stable=True).tolist():
        point, centre = divmod(pair, regions)
        if member[point] < 0 and room[centre] > 0:
            member[point] = centre
            room[centre] -= 1
    return torch.tensor(member, device=distance.device)
