# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of a batch and its exact gradient, accumulated over micro-batches.

A whole batch is padded to its largest scene, and what its forward pass keeps for the backward pass
is far larger than the cache. Here the scenes are sorted by size and split into micro-batches; each
runs forward and backward, its memory is freed before the next one starts, and the gradients are
added. With several threads the micro-batches run in parallel, one thread each: the operators of a
micro-batch are too small to be parallelised themselves. The order of all sums is fixed, so the
same batch gives the same bits.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch_geometric.data import Batch

from mtpgo_training.scenes.scene_dataset import dense
from mtpgo_training.training.losses.ewta_loss import observed_agents

Fields = Mapping[str, Tensor]

MICRO_BATCH_AGENTS = 190
"""Target number of agents in a micro-batch (measured): few enough for the cache, enough to
outweigh the cost of calling the operators."""

MIN_MICRO_BATCH_AGENTS = 80
"""With fewer agents most of the time goes into calling the operators (measured)."""

SINGLE_AGENT_COST = 32
"""Cost of what is computed for an agent alone, in units of one of its neighbours (measured)."""


@dataclass(frozen=True)
class MicroBatch:
    """Scenes of a batch that are computed together.

    Attributes:
        fields: [b, n, ...] each, as wide as the largest of these scenes.
        share: share of the batch's weight, by which the average loss of these scenes counts.
    """

    fields: dict[str, Tensor]
    share: float


def micro_batch_count(sizes: Sequence[int], threads: int) -> int:
    """Return the number of micro-batches: a multiple of ``threads`` near ``MICRO_BATCH_AGENTS``.

    Args:
        sizes: number of agents of each scene.
        threads: that compute them. Some stay idle if the micro-batches would be too small.
    """
    agents = sum(sizes)
    count = -(-max(1, round(agents / MICRO_BATCH_AGENTS)) // threads) * threads
    return max(1, min(count, agents // MIN_MICRO_BATCH_AGENTS))


def split_by_size(sizes: Sequence[int], parts: int) -> list[list[int]]:
    """Return indices of scenes, the largest first, in parts with about equally many agents.

    Args:
        sizes: number of agents of each scene, or another measure to be divided equally.
        parts: how many; fewer are returned if there are hardly more scenes than parts.
    """
    order = sorted(range(len(sizes)), key=lambda i: (-sizes[i], i))
    share = max(sum(sizes), 1) / parts
    result: dict[int, list[int]] = {}
    before = 0
    for scene in order:
        result.setdefault(int((before + 0.5 * sizes[scene]) / share), []).append(scene)
        before += sizes[scene]
    return list(result.values())


def process_share(sizes: Sequence[int], rank: int, processes: int) -> list[int]:
    """Return the indices of the scenes that one of several processes computes.

    Each process gets scenes of similar size, which needs little padding, and about the same work:
    the cost of an agent grows with its number of neighbours.

    Args:
        sizes: number of agents of each scene of a batch.
        rank: number of the process.
        processes: that share the batch.
    """
    if processes > 1:
        parts = split_by_size([n * (n + SINGLE_AGENT_COST) for n in sizes], processes)
        if len(parts) == processes:
            return parts[rank]
    return list(range(rank, len(sizes), processes))


def micro_batches(batch: Batch, by_agent: bool = False) -> list[MicroBatch]:
    """Return the micro-batches of a PyG batch; on an accelerator the whole batch is the only one.

    Large operators keep an accelerator busy.

    Args:
        batch: of graphs.
        by_agent: see :func:`split_fields`.
    """
    fields = dense(batch)
    if fields["x"].device.type != "cpu":
        return [MicroBatch(fields, 1.0)]
    sizes = batch.ptr.diff().tolist()
    return split_fields(fields, sizes, micro_batch_count(sizes, torch.get_num_threads()), by_agent)


def split_fields(
    fields: Fields, sizes: Sequence[int], count: int, by_agent: bool = False
) -> list[MicroBatch]:
    """Return the micro-batches of a dense batch.

    Args:
        fields: from :func:`mtpgo_training.scenes.scene_dataset.dense`.
        sizes: number of agents of each of its scenes.
        count: number of micro-batches, see :func:`split_by_size`.
        by_agent: the loss is an average over observed agents instead of weighted agent-steps.
    """
    if count <= 1:
        return [MicroBatch(dict(fields), 1.0)]
    of = observed_agents if by_agent else torch.sum
    total = float(of(fields["weight"]).clamp(min=1e-6))
    result = []
    for scenes in split_by_size(sizes, count):
        widest = max(sizes[scenes[0]], 1)
        index = torch.tensor(scenes)
        some = {name: value[index, :widest] for name, value in fields.items()}
        result.append(MicroBatch(some, float(of(some["weight"])) / total))
    return result


def accumulated_loss(
    model: nn.Module,
    parts: Sequence[MicroBatch],
    loss_of: Callable[[Fields], Tensor],
    threads: int | None = None,
) -> Tensor:
    """Return the average loss over all micro-batches, a scalar whose gradient is already computed.

    Args:
        model: the network, whose parameters the loss depends on. It must not draw random numbers
            nor keep running statistics if ``threads`` is more than 1.
        parts: from :func:`split_fields`.
        loss_of: the loss of one micro-batch, an average weighted with ``weight``.
        threads: number of micro-batches computed in parallel; by default torch's threads.
    """
    if len(parts) == 1:
        return parts[0].share * loss_of(parts[0].fields)
    threads = threads or torch.get_num_threads()
    parameters = [p for p in model.parameters() if p.requires_grad]
    with_grad = torch.is_grad_enabled() and bool(parameters)
    modes = _thread_modes(with_grad)

    def compute(part: MicroBatch) -> tuple[Tensor, Sequence[Tensor | None]]:
        with modes():
            loss = part.share * loss_of(part.fields)
            if not with_grad:
                return loss, ()
            return loss.detach(), torch.autograd.grad(loss, parameters, allow_unused=True)

    if not with_grad:
        return torch.stack([loss for loss, _ in _map_threads(compute, parts, threads)]).sum()
    result: Tensor = _PrecomputedGradient.apply(
        lambda: _sum(_map_threads(compute, parts, threads)), *parameters
    )
    return result


class _PrecomputedGradient(torch.autograd.Function):
    """A loss with its gradients, which looks ordinary to optimisers, hooks and DDP."""

    @staticmethod
    def forward(ctx: Any, compute: Callable[[], Any], *parameters: Tensor) -> Tensor:
        loss, ctx.gradients = compute()
        return loss

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None
        return None, *(None if g is None else g * grads[0] for g in gradients)


def _sum(
    parts: Sequence[tuple[Tensor, Sequence[Tensor | None]]],
) -> tuple[Tensor, list[Tensor | None]]:
    """Sum losses and gradients in order; a parameter that no micro-batch used has no gradient."""
    loss = torch.stack([value for value, _ in parts]).sum()
    sums: list[Tensor | None] = []
    for grads in zip(*(of_part for _, of_part in parts), strict=True):
        known = [g for g in grads if g is not None]
        if len(known) < 2:
            sums.append(known[0] if known else None)
            continue
        total = known[0] + known[1]
        for g in known[2:]:
            total.add_(g)
        sums.append(total)
    return loss, sums


def _map_threads(
    compute: Callable[[MicroBatch], Any], parts: Sequence[MicroBatch], threads: int
) -> list[Any]:
    """Return the results in the order of the micro-batches."""
    if threads <= 1:
        return [compute(part) for part in parts]
    pool, own = _pool(threads), torch.get_num_threads()
    # The number of threads of matrix products is one for the whole process, whichever thread sets
    # it. It must be 1 meanwhile, or each product would be split among threads that are busy.
    torch.set_num_threads(1)
    try:
        return list(pool.map(compute, parts))
    finally:
        torch.set_num_threads(own)


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Return threads that run their operators alone; cached, because starting them takes time."""
    own = torch.get_num_threads()
    pool = ThreadPoolExecutor(
        threads, "micro-batch", initializer=torch.set_num_threads, initargs=(1,)
    )
    # All threads start here, so that the setting below is the last one.
    list(pool.map(lambda barrier: barrier.wait(), [threading.Barrier(threads)] * threads))
    torch.set_num_threads(own)
    return pool


def _thread_modes(grad: bool) -> Callable[[], Any]:
    """Return the caller's autograd and autocast modes, which a thread does not inherit."""
    kinds = [kind for kind in ("cpu", "cuda") if torch.is_autocast_enabled(kind)]
    dtypes = [torch.get_autocast_dtype(kind) for kind in kinds]

    @contextlib.contextmanager
    def modes() -> Iterator[None]:
        with contextlib.ExitStack() as stack:
            stack.enter_context(torch.set_grad_enabled(grad))
            for kind, dtype in zip(kinds, dtypes, strict=True):
                stack.enter_context(torch.autocast(kind, dtype))
            yield

    return modes
