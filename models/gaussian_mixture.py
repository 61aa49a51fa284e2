# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The Gaussian mixture of the output (eq. 26): likelihood (eq. 27), bias to stay, local mean."""

import math

import torch
from torch import Tensor

PIVOT = 1e-7
"""Least share of a variance that is left after conditioning on the components before it.

Chosen: float32's rounding, below which a Cholesky pivot could become negative.
"""

STAY_M = 0.5
"""How near its place at t an agent ends that stays there (m), as a standard deviation; chosen on
left-out sites (docs/design.md, "Weight of staying")."""


def gaussian_log_prob(mean: Tensor, covariance: Tensor, target: Tensor) -> Tensor:
    """Return [...] the log density of Gaussians, by a Cholesky factorisation over the batch.

    Args:
        mean: [..., S].
        covariance: [..., S, S]; only the lower triangle is read.
        target: [..., S], broadcast against the mean.
    """
    size = mean.size(-1)
    offset = (target - mean).unbind(-1)
    # Unbound, not indexed: the gradient of an index fills the whole array with zeros.
    entries = covariance.flatten(-2).unbind(-1)
    whitened: list[Tensor] = []
    factor: list[list[Tensor]] = []
    result = torch.full((), -0.5 * size * math.log(2.0 * math.pi), device=mean.device)
    for i in range(size):
        row: list[Tensor] = []
        rest = offset[i]
        variance = entries[i * size + i]
        left = variance
        for j in range(i):
            entry = entries[i * size + j]
            for k in range(j):
                entry = entry - row[k] * factor[j][k]
            entry = entry / factor[j][j]
            row.append(entry)
            rest = rest - entry * whitened[j]
            left = left - entry * entry
        pivot = torch.sqrt(torch.maximum(left, PIVOT * variance))
        row.append(pivot)
        factor.append(row)
        whitened.append(rest / pivot)
        result = result - torch.log(pivot) - 0.5 * whitened[i] * whitened[i]
    return result


def mode_log_prob(mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Return [B, N, M, H] the log density that each mode gives to each future state.

    Args:
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] (or more columns, the first S count); any value where masked.
        mask: [B, N, H] true where the target is known; elsewhere a value without meaning, of
            which no gradient can overflow.
    """
    target = target[..., : mean.size(-1)].unsqueeze(2)
    # Where the truth is unknown the mean replaces it, so that no gradient can overflow.
    target = torch.where(mask[:, :, None, :, None], target, mean.detach())
    return gaussian_log_prob(mean, covariance, target)


def mixture_nll(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return [B, N, H] the negative log-likelihood of each future state, zero where masked.

    The summands of the NLL loss, eq. 27: -log sum_j pi_j N(x_k | x_k^j, P_k^j).

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] (or more columns, the first S count); any value where masked.
        mask: [B, N, H] true where the target is known.
    """
    log_prob = log_weight.unsqueeze(-1) + mode_log_prob(mean, covariance, target, mask)
    nll = -torch.logsumexp(log_prob, dim=2)
    return torch.where(mask, nll, torch.zeros_like(nll))


def position_nll(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return [B, N, H] :func:`mixture_nll` of the position alone (nats, densities per m^2)."""
    return mixture_nll(log_weight, mean[..., :2], covariance[..., :2, :2], target[..., :2], mask)


def favour_staying(
    log_weight: Tensor,
    mean: Tensor,
    place: Tensor,
    share: Tensor,
    bias: float,
    width_m: float = STAY_M,  # TorchScript sees no constants of the module
) -> Tensor:
    """Return log mixture weights [B, N, M] with which it is likelier that standing agents stay.

    The logarithm of a mode's weight grows by bias exp(-d^2 / (2 width^2)), d being how far from
    the agent's place at t the mode ends; then the weights are normalised.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S], x and y first (m).
        place: [B, N, 2] at t, in the same frame (m).
        share: [B, N] of its motion, 0 for agents that stand and 1 for those that move, whose
            weights stay as they are.
        bias: of agents that stand, for a mode that ends where it begins.
        width_m: see :data:`STAY_M` (m).
    """
    way = (mean[:, :, :, -1, :2] - place.unsqueeze(2)) / width_m  # [B, N, M, 2]
    stays = torch.exp(-0.5 * way.square().sum(dim=-1))
    return torch.log_softmax(log_weight + bias * (1.0 - share).unsqueeze(-1) * stays, dim=-1)


def settle_standing(
    mean: Tensor,
    place: Tensor,
    velocity: Tensor,
    share: Tensor,
    dt_s: float,
    width_m: float = STAY_M,  # TorchScript sees no constants of the module
) -> Tensor:
    """Return the means with modes in which a standing agent hardly moves drawn to uniform motion.

    A mode comes nearer by the share exp(-d^2 / (2 width^2)), d being how far it ends from where
    uniform motion does: a learned mode that stays creeps some centimetres, one that goes is left
    as it is.

    Args:
        mean: [B, N, M, H, S], x and y first (m), then the velocities (m/s) where S is 4.
        place: [B, N, 2] at t, in the same frame (m).
        velocity: [B, N, 2] at t, in the same frame (m/s).
        share: [B, N] of its motion, 0 for agents that stand and 1 for those that move, whose modes
            stay as they are.
        dt_s: step of the horizon (s).
        width_m: see :data:`STAY_M` (m).
    """
    steps = torch.arange(1, mean.size(3) + 1, device=mean.device, dtype=mean.dtype)
    velocity = velocity.unsqueeze(2).expand(-1, -1, mean.size(3), -1)  # [B, N, H, 2]
    uniform = place.unsqueeze(2) + velocity * (dt_s * steps).view(1, 1, -1, 1)
    if mean.size(4) == 4:
        uniform = torch.cat((uniform, velocity), dim=-1)
    away = uniform.unsqueeze(2) - mean  # [B, N, M, H, S]
    squared = (away[:, :, :, -1, :2] / width_m).square().sum(dim=-1)
    near = (1.0 - share).unsqueeze(-1) * torch.exp(-0.5 * squared)  # [B, N, M]
    return mean + near[..., None, None] * away


def heaviest_at_local_mean(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, share: Tensor, kernel: Tensor
) -> Tensor:
    """Return the means with each agent's heaviest mode moved to the mean of the modes around it.

    The modes are weighted by pi_j exp(-d_j^2 / (2 kernel^2)), with d_j their distance from the
    heaviest mode at the end of the horizon in standard deviations of that mode. This is one step
    of the mean shift (Comaniciu and Meer, 2002), from a component's mean towards the mode of the
    mixture's density. Where the modes err in different directions, their mean errs less than any.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S], x and y first.
        covariance: [B, N, M, H, S', S'] of x and y first.
        share: [B, N] of the way that is moved, 0 to 1.
        kernel: [B, N] in standard deviations, 0 where the mode stays where it is.
    """
    scenes, agents, modes = log_weight.size(0), log_weight.size(1), log_weight.size(2)
    heaviest = torch.argmax(log_weight, dim=2, keepdim=True)  # [B, N, 1]
    row = torch.arange(scenes * agents, device=mean.device) * modes + heaviest.flatten()
    places = mean[:, :, :, -1, :2]  # [B, N, M, 2]
    middle = places.flatten(0, 2)[row].view(scenes, agents, 1, 2)
    spread = covariance[:, :, :, -1, :2, :2].flatten(0, 2)[row].view(scenes, agents, 1, 2, 2)
    xx, xy, yy = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    x, y = (places - middle).unbind(-1)  # [B, N, M]
    squared = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
    moves = kernel > 0.0
    width = torch.where(moves, kernel, torch.ones_like(kernel)).unsqueeze(-1)
    near = torch.softmax(log_weight - squared / (2.0 * width * width), dim=2)
    paths = mean.flatten(3)  # [B, N, M, H S]
    # No matrix product, which autocast would narrow to where places have a grid of half a metre.
    local = (near.unsqueeze(-1) * paths).sum(dim=2, keepdim=True)  # [B, N, 1, H S]
    first = paths.flatten(0, 2)[row].view(scenes, agents, 1, -1)
    moved = first + (share * moves)[..., None, None] * (local - first)
    chosen = torch.arange(modes, device=mean.device) == heaviest  # [B, N, M]
    return torch.where(chosen.unsqueeze(-1), moved, paths).view_as(mean)
