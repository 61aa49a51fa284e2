# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Speed and memory of a training step: ours and the reference implementation's in turns.

Ours is measured twice: as ``mtpgo train`` works on two cores by default, with two processes of one
thread each that sum their gradients, and with one process of two threads.
"""

from __future__ import annotations

import contextlib
import functools
import statistics
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch_geometric.data import Batch
from tqdm import tqdm

from models import ModelConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.benchmark.latency_benchmark import make_model
from mtpgo_training.benchmark.measurement.machine import heading, table, write_json
from mtpgo_training.benchmark.measurement.step_workers import Step, Team, sum_gradients
from mtpgo_training.benchmark.reference_mtp_go import ReferenceMTPGO
from mtpgo_training.training.losses.batch_loss import batch_loss
from mtpgo_training.training.losses.ewta_loss import ewta_loss
from mtpgo_training.training.losses.gradient_accumulation import process_share
from mtpgo_training.training.losses.likelihood_loss import negative_log_likelihood
from mtpgo_training.training.losses.schedules import LossWeights
from mtpgo_training.training.trial.arc_traffic import arc_batch

PHASES = {"EWTA": LossWeights(8, 1.0, 0.0), "NLL": LossWeights(1, 0.0, 1.0)}

LARGEST_DIFFERENCE = 1e-3
"""Largest relative difference of losses and gradients; more is an error, not a result."""

ROUNDS_BEFORE = 2
"""Steps that are not counted, in which memory is allocated and threads are started."""


COLUMNS = {
    "phase": "{.phase}",
    "scenes": "{.scenes}",
    "agents": "{.agents}",
    "processes": "{.processes}",
    "threads": "{.threads}",
    "samples/s": "{.samples_per_s:.0f}",
    "straightforward": "{.plain_samples_per_s:.0f}",
    "ratio": "{.ratio:.1f}",
    "memory MB": "{.growth_mb:.0f}",
    "straightforward MB": "{.plain_growth_mb:.0f}",
    "share": "{.memory_share:.0%}",
}
"""Heading and format of each column of the printed table."""


@dataclass(frozen=True)
class TrainingRow:
    """One line of the table.

    Attributes:
        phase: EWTA or NLL.
        scenes: graphs in the batch.
        agents: agents in all graphs.
        processes: how many share a batch, ours.
        threads: of torch in each process.
        samples_per_s: scenes per second, ours.
        plain_samples_per_s: of the straightforward implementation, on as many threads in all.
        ratio: of the two, the median over the rounds.
        growth_mb: by how much training raises the processes' largest memory, ours, summed (MB).
        plain_growth_mb: of the straightforward implementation (MB).
        memory_share: of the two.
        gradient_difference: largest difference of the parameters' gradients, as a share of
            each gradient's norm.
    """

    phase: str
    scenes: int
    agents: int
    processes: int
    threads: int
    samples_per_s: float
    plain_samples_per_s: float
    ratio: float
    growth_mb: float
    plain_growth_mb: float
    memory_share: float
    gradient_difference: float


def plain_loss(model: ReferenceMTPGO, batch: Batch, aim: LossWeights) -> Tensor:
    """Return the loss of ``training.batch_loss``, by the reference implementation."""
    log_weight, mean, covariance = (
        part.unsqueeze(0)
        for part in model.roll_out(batch.x, batch.valid, batch.static, batch.batch, aim.nll > 0.0)
    )
    target, weight = batch.target.unsqueeze(0), batch.weight.unsqueeze(0)
    loss = mean.new_zeros(())
    if aim.ewta > 0.0:
        loss = loss + aim.ewta * ewta_loss(mean, target, weight, aim.winners)
    if aim.nll > 0.0:
        nll = negative_log_likelihood(log_weight, mean, covariance, target, weight)
        loss = loss + aim.nll * nll
    return loss


def gradients(loss: Callable[[], Tensor], model: nn.Module) -> tuple[float, dict[str, Tensor]]:
    """Return a loss and the gradients of all parameters that have one."""
    model.zero_grad()
    value = loss()
    value.backward()
    found = {n: p.grad.clone() for n, p in model.named_parameters() if p.grad is not None}
    model.zero_grad()
    return float(value.detach()), found


def largest_difference(scenes: int, phase: str, seed: int = 0) -> float:
    """Return the largest difference of losses and gradients, see :class:`TrainingRow`."""
    model, aim = make_model(seed).requires_grad_(True).train(), PHASES[phase]
    plain = ReferenceMTPGO(model.config, model.state_dict())
    batch = arc_batch(scenes, model.config, seed)
    loss, mine = gradients(lambda: batch_loss(model, batch, aim), model)
    other, theirs = gradients(lambda: plain_loss(plain, batch, aim), plain)
    worst = abs(loss - other) / abs(other)
    floor = 1e-6 * float(torch.stack([g.norm() for g in mine.values()]).norm())
    for name, grad in mine.items():
        worst = max(
            worst,
            float((grad - theirs[name.replace(".", "/")]).norm() / grad.norm().clamp(min=floor)),
        )
    return worst


def make_step(name: str, phase: str, scenes: int, rank: int = 0, processes: int = 1) -> Step:
    """Return one optimisation step of an implementation.

    Args:
        name: ``ours`` or ``plain``, the reference implementation.
        phase: one of ``PHASES``.
        scenes: graphs in the whole batch.
        rank: of this process; its share is that of ``mtpgo train``.
        processes: how many share the batch.
    """
    model, aim = make_model().requires_grad_(True).train(), PHASES[phase]
    whole = arc_batch(scenes, model.config)
    mine = process_share(whole.ptr.diff().tolist(), rank, processes)
    batch = Batch.from_data_list(whole.index_select(mine))
    share = float(batch.weight.sum() / whole.weight.sum())
    plain = ReferenceMTPGO(model.config, model.state_dict())
    network = model if name == "ours" else plain
    optimiser = torch.optim.AdamW(network.parameters(), lr=1e-4)

    def step() -> float:
        optimiser.zero_grad(set_to_none=True)
        if name == "ours":
            loss = share * batch_loss(model, batch, aim)
        else:
            loss = share * plain_loss(plain, batch, aim)
        loss.backward()
        if processes > 1:
            sum_gradients(network)
        optimiser.step()
        return float(loss.detach())

    return step


def measure(phase: str, scenes: int, threads: int, rounds: int) -> list[TrainingRow]:
    """Measure one phase of training: with a process per thread, and with one process.

    Args:
        phase: one of ``PHASES``.
        scenes: graphs in the batch.
        threads: total number.
        rounds: steps of every implementation, in turns.

    Raises:
        ConfigurationError: the implementations do not agree.
    """
    difference = largest_difference(min(scenes, 32), phase)
    _check(phase, "gradients", difference)
    divisions = sorted({(threads, 1), (1, threads)}, reverse=True)
    ours = functools.partial(make_step, "ours", phase, scenes)
    plain = functools.partial(make_step, "plain", phase, scenes)
    with contextlib.ExitStack() as stack:
        teams = [
            stack.enter_context(Team(step, processes, each))
            for step, (processes, each) in [*((ours, d) for d in divisions), (plain, (1, threads))]
        ]
        losses = [team.step()[1] for team in teams]
        _check(phase, "losses", max(abs(loss / losses[-1] - 1.0) for loss in losses))
        seconds: list[list[float]] = [[] for _ in teams]
        for i in range(1 - ROUNDS_BEFORE, rounds):
            for team, found in zip(teams, seconds, strict=True):
                time_s = team.step()[0]
                if i >= 0:
                    found.append(time_s)
        rate = [scenes / statistics.median(found) for found in seconds]
        # Round by round, so that a machine that slows down for a while slows both down.
        ratio = [
            statistics.median(plain / ours for ours, plain in zip(found, seconds[-1], strict=True))
            for found in seconds
        ]
        growth = [team.growth_mb() for team in teams]
    return [
        TrainingRow(
            phase=phase,
            scenes=scenes,
            agents=int(arc_batch(scenes, ModelConfig()).num_nodes),
            processes=processes,
            threads=each,
            samples_per_s=rate[i],
            plain_samples_per_s=rate[-1],
            ratio=ratio[i],
            growth_mb=growth[i],
            plain_growth_mb=growth[-1],
            memory_share=growth[i] / growth[-1],
            gradient_difference=difference,
        )
        for i, (processes, each) in enumerate(divisions)
    ]


def _check(phase: str, what: str, difference: float) -> None:
    if not difference <= LARGEST_DIFFERENCE:
        raise ConfigurationError(
            f"in the {phase} phase the {what} of the implementations differ by {difference:.1e}, "
            f"expected at most {LARGEST_DIFFERENCE:.0e}"
        )


def print_training(
    scenes: int, threads: int, rounds: int, command: str, output: Path | None
) -> list[TrainingRow]:
    """Measure both phases, print the table and write it.

    Args:
        scenes: graphs in the batch.
        threads: total number.
        rounds: steps of every implementation, in turns.
        command: the command line, printed above the table.
        output: JSON file with the machine and ``rows``, or None.
    """
    above = heading(command)
    rows = [
        row
        for phase in tqdm(PHASES, unit="phase", disable=None)
        for row in measure(phase, scenes, threads, rounds)
    ]
    print(above)
    print(table(rows, COLUMNS))
    if output is not None:
        write_json(output, {"command": command, "rows": [asdict(row) for row in rows]})
    return rows
