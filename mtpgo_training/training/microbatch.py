# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of a batch and its exact gradient, from groups of scenes of similar size.

A batch in one piece is as wide as its largest scene, and what its forward pass keeps for the
backward pass lies far outside of the cache. Here the scenes are sorted by size and cut into
groups; each group goes forward and backward at once, its memory is free before the next, and the
gradients are added. With several threads the groups run beside each other, one thread each: the
operators of a group are too small to be shared among threads themselves. The order of all sums is
fixed, so the same batch gives the same bits.
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

Fields = Mapping[str, Tensor]

GROUP_AGENTS = 190
"""Agents of a group, about: few enough for the cache, enough to be worth starting operators."""


LEAST_AGENTS = 80
"""With fewer agents in a group most of the time goes into starting operators."""


ALONE_AGENTS = 32
"""Agents around one that cost about as much as what is done for each agent alone."""


@dataclass(frozen=True)
class Group:
    """Scenes that are worked on together.

    Attributes:
        fields: [b, n, ...] each, as wide as the largest of these scenes.
        share: the group's part of the batch's weight, by which its average loss counts.
    """

    fields: dict[str, Tensor]
    share: float


def how_many(sizes: Sequence[int], threads: int) -> int:
    """Groups for a batch: of ``GROUP_AGENTS`` about, and the same number for each thread.

    Args:
        sizes: agents of each scene.
        threads: that will work on them. So many that the groups would be tiny are not served.
    """
    agents = sum(sizes)
    groups = -(-max(1, round(agents / GROUP_AGENTS)) // threads) * threads
    return max(1, min(groups, agents // LEAST_AGENTS))


def cut(sizes: Sequence[int], groups: int) -> list[list[int]]:
    """Indices of scenes, the largest first, in parts with about equally many agents.

    Args:
        sizes: agents of each scene, or any other measure that is to be shared equally.
        groups: how many; fewer come out where there are hardly more scenes than groups.
    """
    order = sorted(range(len(sizes)), key=lambda i: (-sizes[i], i))
    share = max(sum(sizes), 1) / groups
    parts: dict[int, list[int]] = {}
    before = 0
    for scene in order:
        parts.setdefault(int((before + 0.5 * sizes[scene]) / share), []).append(scene)
        before += sizes[scene]
    return list(parts.values())


def share_of(sizes: Sequence[int], rank: int, processes: int) -> list[int]:
    """Indices of the scenes that one of several processes works on.

    Each process gets scenes of similar size, which leaves little padding, and about the same work:
    that on an agent grows with those around it.

    Args:
        sizes: agents of each scene of a batch.
        rank: of the process.
        processes: that share the batch.
    """
    parts = cut([n * (n + ALONE_AGENTS) for n in sizes], processes) if processes > 1 else []
    if len(parts) == processes:
        return parts[rank]
    return list(range(rank, len(sizes), processes))


def groups_of(batch: Batch) -> list[Group]:
    """The groups of a PyG batch; in one piece on an accelerator, which is best kept busy so."""
    fields = dense(batch)
    if fields["x"].device.type != "cpu":
        return [Group(fields, 1.0)]
    sizes = batch.ptr.diff().tolist()
    return group_fields(fields, sizes, how_many(sizes, torch.get_num_threads()))


def group_fields(fields: Fields, sizes: Sequence[int], groups: int) -> list[Group]:
    """The groups of a dense batch of :func:`mtpgo_training.scenes.scene_dataset.dense`.

    Args:
        fields: the batch.
        sizes: agents of each of its scenes.
        groups: see :func:`cut`.
    """
    if groups <= 1:
        return [Group(dict(fields), 1.0)]
    total = float(fields["weight"].sum().clamp(min=1e-6))
    result = []
    for scenes in cut(sizes, groups):
        widest = max(sizes[scenes[0]], 1)
        index = torch.tensor(scenes)
        some = {name: value[index, :widest] for name, value in fields.items()}
        result.append(Group(some, float(some["weight"].sum()) / total))
    return result


def grouped_loss(
    model: nn.Module,
    groups: Sequence[Group],
    loss_of: Callable[[Fields], Tensor],
    threads: int | None = None,
) -> Tensor:
    """The average of a loss over all groups, a scalar whose gradient is known already.

    Args:
        model: the network, whose parameters the loss depends on. It must not draw random numbers
            nor keep running statistics where ``threads`` is more than 1.
        groups: of :func:`group_fields`.
        loss_of: the loss of one group, an average weighted with ``weight``.
        threads: how many groups are worked on at a time; by default as many as torch would take.
    """
    if len(groups) == 1:
        return groups[0].share * loss_of(groups[0].fields)
    threads = threads or torch.get_num_threads()
    parameters = [p for p in model.parameters() if p.requires_grad]
    wanted = torch.is_grad_enabled() and bool(parameters)
    modes = _thread_modes(wanted)

    def work(group: Group) -> tuple[Tensor, Sequence[Tensor | None]]:
        with modes():
            loss = group.share * loss_of(group.fields)
            if not wanted:
                return loss, ()
            return loss.detach(), torch.autograd.grad(loss, parameters, allow_unused=True)

    if not wanted:
        return torch.stack([loss for loss, _ in _spread(work, groups, threads)]).sum()
    result: Tensor = _Known.apply(lambda: _total(_spread(work, groups, threads)), *parameters)
    return result


class _Known(torch.autograd.Function):
    """A loss that comes with its gradients, so that optimisers, hooks and DDP see nothing new."""

    @staticmethod
    def forward(ctx: Any, compute: Callable[[], Any], *parameters: Tensor) -> Tensor:
        loss, ctx.gradients = compute()
        return loss

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        gradients, ctx.gradients = ctx.gradients, None
        return None, *(None if g is None else g * grads[0] for g in gradients)


def _total(
    parts: Sequence[tuple[Tensor, Sequence[Tensor | None]]],
) -> tuple[Tensor, list[Tensor | None]]:
    """Sums in the groups' order. A parameter that no group used has no gradient."""
    loss = torch.stack([value for value, _ in parts]).sum()
    sums: list[Tensor | None] = []
    for grads in zip(*(of_group for _, of_group in parts), strict=True):
        known = [g for g in grads if g is not None]
        if len(known) < 2:
            sums.append(known[0] if known else None)
            continue
        total = known[0] + known[1]
        for g in known[2:]:
            total.add_(g)
        sums.append(total)
    return loss, sums


def _spread(work: Callable[[Group], Any], groups: Sequence[Group], threads: int) -> list[Any]:
    """The results in the groups' order."""
    if threads <= 1:
        return [work(group) for group in groups]
    pool, own = _pool(threads), torch.get_num_threads()
    # The number for matrix products is one for the whole process, whichever thread sets it: while
    # the groups run it must be 1, or each product would be shared among threads that are busy.
    torch.set_num_threads(1)
    try:
        return list(pool.map(work, groups))
    finally:
        torch.set_num_threads(own)


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads of which each runs its operators alone; kept, for starting them takes time."""
    own = torch.get_num_threads()
    pool = ThreadPoolExecutor(threads, "group", initializer=torch.set_num_threads, initargs=(1,))
    # All threads begin here, so that the setting below is the last.
    list(pool.map(lambda barrier: barrier.wait(), [threading.Barrier(threads)] * threads))
    torch.set_num_threads(own)
    return pool


def _thread_modes(grad: bool) -> Callable[[], Any]:
    """The caller's autograd and autocast modes, which a thread does not inherit."""
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
