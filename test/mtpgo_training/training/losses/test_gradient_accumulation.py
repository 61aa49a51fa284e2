# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Micro-batches give the same loss and gradient as the whole batch."""

import dataclasses
import functools
import itertools
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from models import MTPGO, ModelConfig
from mtpgo_training.training.losses.batch_loss import training_loss
from mtpgo_training.training.losses.gradient_accumulation import (
    SINGLE_AGENT_COST,
    Fields,
    accumulated_loss,
    micro_batch_count,
    process_share,
    split_by_size,
    split_fields,
)
from mtpgo_training.training.losses.likelihood_loss import trajectory_likelihood_loss
from mtpgo_training.training.losses.schedules import LossWeights

SIZES = [3, 1, 6, 2, 2, 5, 4, 1, 3, 2]
CONFIG = ModelConfig(history_steps=4, horizon_steps=3, modes=3, hidden=16, ode_hidden=4)
WITH_TRAILS = dataclasses.replace(
    CONFIG, static_features=True, static_inputs="all", trail_branches=2, hold_standing=True
)


@pytest.fixture
def model() -> MTPGO:
    torch.manual_seed(0)
    return MTPGO(CONFIG)


@pytest.fixture
def trail_model() -> MTPGO:
    torch.manual_seed(0)
    return MTPGO(WITH_TRAILS)


@pytest.fixture
def trail_fields(fields: dict[str, Tensor]) -> dict[str, Tensor]:
    """The same batch with trails and several classes."""
    draw = torch.Generator().manual_seed(2)
    size, steps = fields["weight"].shape[:2], CONFIG.horizon_steps
    there = fields["valid"][..., -1]
    trails = torch.randn(*size, WITH_TRAILS.trail_branches, steps, 3, generator=draw)
    trails[..., 2] = trails[..., 2].relu()
    kind = torch.randint(CONFIG.static_size, size, generator=draw)
    static = nn.functional.one_hot(kind, CONFIG.static_size).float()
    return {
        **fields,
        "static": static * there[..., None],
        "trails": trails * there[..., None, None, None],
    }


@pytest.fixture
def fields() -> dict[str, Tensor]:
    """A dense batch; in each scene one future is unknown, and in one scene all are."""
    draw = torch.Generator().manual_seed(1)
    scenes, widest = len(SIZES), max(SIZES)
    there = torch.arange(widest) < torch.tensor(SIZES).unsqueeze(1)
    x = torch.randn(scenes, widest, CONFIG.history_steps, CONFIG.feature_size, generator=draw)
    x[..., :2] *= 20.0
    target = torch.randn(scenes, widest, CONFIG.horizon_steps, 4, generator=draw)
    weight = there.float().unsqueeze(-1).repeat(1, 1, CONFIG.horizon_steps)
    weight[:, 0, -1] = 0.0
    weight[3] = 0.0
    static = torch.zeros(scenes, widest, CONFIG.static_size)
    static[..., 0] = 1.0
    valid = there.unsqueeze(-1).repeat(1, 1, CONFIG.history_steps)
    valid[2, 1, :2] = False
    return {"x": x, "valid": valid, "static": static, "target": target, "weight": weight}


def loss_of(model: nn.Module, aim: LossWeights) -> functools.partial[Tensor]:
    return functools.partial(training_loss, model, weights=aim)


def gradients(model: nn.Module) -> list[Tensor | None]:
    found = [None if p.grad is None else p.grad.clone() for p in model.parameters()]
    model.zero_grad()
    return found


def test_split_keeps_every_scene_once_and_sorts_by_size() -> None:
    for count in (1, 2, 3, 10, 20):
        parts = split_by_size(SIZES, count)
        assert len(parts) <= count
        assert all(parts)
        assert sorted(i for part in parts for i in part) == list(range(len(SIZES)))
        sizes = [SIZES[i] for part in parts for i in part]
        assert sizes == sorted(SIZES, reverse=True)


def test_split_makes_parts_of_about_equal_size() -> None:
    sizes = [2 + i % 15 for i in range(128)]
    parts = split_by_size(sizes, 4)
    agents = [sum(sizes[i] for i in part) for part in parts]
    assert len(parts) == 4
    assert max(agents) - min(agents) <= 2 * max(sizes)
    assert sum(len(part) * sizes[part[0]] for part in parts) < 0.8 * 16 * 128


def test_number_of_micro_batches() -> None:
    assert (
        micro_batch_count([9] * 128, threads=1) == 6
    )  # 1152 agents in micro-batches of about 190
    assert micro_batch_count([9] * 128, threads=4) == 8
    assert micro_batch_count([9] * 128, threads=3) == 6
    assert micro_batch_count([9] * 128, threads=64) == 14
    assert micro_batch_count([4], threads=1) == 1
    assert micro_batch_count([4], threads=2) == 1
    assert micro_batch_count([], threads=2) == 1


def test_micro_batches_are_as_narrow_as_their_scenes(fields: dict[str, Tensor]) -> None:
    parts = split_fields(fields, SIZES, 3)
    widths = [part.fields["x"].size(1) for part in parts]
    assert widths == sorted(widths, reverse=True)
    assert widths[-1] < max(SIZES)
    assert sum(part.share for part in parts) == pytest.approx(1.0)
    for part in parts:
        assert part.fields["valid"][..., -1].sum() > 0


@pytest.mark.parametrize("aim", [LossWeights(2, 1.0, 0.0), LossWeights(1, 0.4, 0.6)])
@pytest.mark.parametrize(("count", "threads"), [(1, 1), (3, 1), (4, 2), (10, 3)])
def test_loss_and_gradient_are_those_of_the_whole_batch(
    model: MTPGO, fields: dict[str, Tensor], aim: LossWeights, count: int, threads: int
) -> None:
    assert_same_as_the_whole_batch(model, fields, loss_of(model, aim), count, threads)


@pytest.mark.parametrize("aim", [LossWeights(2, 1.0, 0.0), LossWeights(1, 0.4, 0.6)])
@pytest.mark.parametrize(("count", "threads"), [(3, 1), (4, 2)])
def test_so_they_are_with_trails_and_the_likelihood_of_trajectories(
    trail_model: MTPGO, trail_fields: dict[str, Tensor], aim: LossWeights, count: int, threads: int
) -> None:
    likelihood = functools.partial(trajectory_likelihood_loss, correlated_steps=2.0)
    loss = functools.partial(loss_of(trail_model, aim), likelihood=likelihood)
    assert_same_as_the_whole_batch(trail_model, trail_fields, loss, count, threads)


def assert_same_as_the_whole_batch(
    model: MTPGO,
    fields: dict[str, Tensor],
    loss_of_part: functools.partial[Tensor],
    count: int,
    threads: int,
) -> None:
    model.double()
    fields = {k: v.double() if v.is_floating_point() else v for k, v in fields.items()}
    whole = loss_of_part(fields)
    whole.backward()
    expected = gradients(model)
    loss = accumulated_loss(model, split_fields(fields, SIZES, count), loss_of_part, threads)
    (2.0 * loss).backward()
    torch.testing.assert_close(loss.detach(), whole.detach(), rtol=1e-10, atol=1e-12)
    for (name, _), mine, other in zip(
        model.named_parameters(), gradients(model), expected, strict=True
    ):
        assert (mine is None) == (other is None), name
        if mine is not None and other is not None:
            torch.testing.assert_close(0.5 * mine, other, rtol=1e-9, atol=1e-11)


def test_the_same_bits_every_time(model: MTPGO, fields: dict[str, Tensor]) -> None:
    parts = split_fields(fields, SIZES, 6)
    found = []
    for _ in range(4):
        loss = accumulated_loss(model, parts, loss_of(model, LossWeights(1, 0.0, 1.0)), 3)
        loss.backward()
        found.append([loss.detach(), *(g for g in gradients(model) if g is not None)])
    for other in found[1:]:
        assert all(torch.equal(a, b) for a, b in zip(found[0], other, strict=True))


def test_without_gradient(model: MTPGO, fields: dict[str, Tensor]) -> None:
    aim = loss_of(model, LossWeights(2, 1.0, 0.0))
    with torch.no_grad():
        loss = accumulated_loss(model, split_fields(fields, SIZES, 4), aim, 2)
        assert not loss.requires_grad
        torch.testing.assert_close(loss, aim(fields))


def test_threads_use_the_modes_of_their_caller(fields: dict[str, Tensor]) -> None:
    """Autocast reaches the threads; each has one torch thread, the caller keeps its number."""
    model = nn.Linear(8, 2)
    seen: list[tuple[torch.dtype, int]] = []

    def loss(some: Fields) -> Tensor:
        out = model(some["x"])
        seen.append((out.dtype, torch.get_num_threads()))
        return out.float().mean()

    before = torch.get_num_threads()
    with torch.autocast("cpu", torch.bfloat16):
        accumulated_loss(model, split_fields(fields, SIZES, 4), loss, 2).backward()
    assert seen == [(torch.bfloat16, 1)] * 4
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("names", [("model", "fields"), ("trail_model", "trail_fields")])
def test_distributed_training_sees_an_ordinary_loss(
    names: tuple[str, str], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """DDP takes the gradients, and does not wait for those of unused parameters."""
    model, fields = (request.getfixturevalue(name) for name in names)
    aim = loss_of(model, LossWeights(2, 1.0, 0.0))
    parts = split_fields(fields, SIZES, 4)
    accumulated_loss(model, parts, aim, 2).backward()
    expected = gradients(model)

    class Loss(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.model = model

        def forward(self) -> Tensor:
            return accumulated_loss(self.model, parts, aim, 2)

    distributed = torch.distributed
    distributed.init_process_group(
        "gloo", init_method=f"file://{tmp_path}/store", rank=0, world_size=1
    )
    try:
        wrapped = nn.parallel.DistributedDataParallel(Loss(), find_unused_parameters=True)
        for _ in range(2):
            wrapped().backward()
            for mine, other in zip(gradients(model), expected, strict=True):
                if other is None:
                    assert mine is None or not mine.any()
                else:
                    assert mine is not None
                    torch.testing.assert_close(mine, other)
        # Its reducer waits for the group's thread, which needs the interpreter: not at the end.
        del wrapped
    finally:
        distributed.destroy_process_group()


def test_micro_batches_need_less_memory() -> None:
    """What the forward pass keeps for the backward pass is freed after each micro-batch."""
    kept: list[int] = []
    most = 0

    class Keep(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, x: Tensor, weight: Tensor) -> Tensor:
            nonlocal most
            kept.append(x.numel())
            most = max(most, sum(kept))
            return (x * weight).mean()

        @staticmethod
        def backward(ctx: Any, *grads: Tensor) -> tuple[None, Tensor]:
            kept.pop()
            return None, grads[0].view(1)

    weight = nn.Linear(1, 1, bias=False)
    fields = {"x": torch.ones(8, 3, 5), "weight": torch.ones(8, 3, 2)}
    for count, expected in ((1, 120), (4, 30)):
        most = 0
        parts = split_fields(fields, [3] * 8, count)
        accumulated_loss(
            weight, parts, lambda f: Keep.apply(f["x"], weight.weight.view(1)), 1
        ).backward()
        assert most == expected


def test_an_error_in_a_micro_batch_reaches_the_caller(fields: dict[str, Tensor]) -> None:
    def fail(some: Fields) -> Tensor:
        raise ValueError("no loss")

    with pytest.raises(ValueError, match="no loss"):
        accumulated_loss(nn.Linear(1, 1), split_fields(fields, SIZES, 4), fail, 2)


@pytest.mark.parametrize("processes", [1, 2, 3, 4])
def test_processes_share_a_batch_by_size(processes: int) -> None:
    draw = torch.Generator().manual_seed(2)
    sizes = torch.randint(1, 17, (40,), generator=draw).tolist()
    shares = [process_share(sizes, rank, processes) for rank in range(processes)]
    assert sorted(i for share in shares for i in share) == list(range(40))
    for larger, smaller in itertools.pairwise(shares):
        assert min(sizes[i] for i in larger) >= max(sizes[i] for i in smaller)
    work = [sum(sizes[i] * (sizes[i] + SINGLE_AGENT_COST) for i in share) for share in shares]
    assert max(work) - min(work) <= 2 * 16 * (16 + SINGLE_AGENT_COST)


def test_one_process_keeps_the_order_and_few_scenes_are_distributed() -> None:
    assert process_share([3, 9, 4], 0, 1) == [0, 1, 2]
    assert [process_share([5], rank, 2) for rank in range(2)] == [[0], []]
