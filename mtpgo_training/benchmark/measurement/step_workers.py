# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that do training steps on command, so that two implementations can take turns."""

from __future__ import annotations

import contextlib
import multiprocessing
import resource
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from torch import nn

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.training.torch_process import prepare_process

Step = Callable[[], float]
"""Does one step on a process's share of the batch and returns its part of the batch's loss."""

MakeStep = Callable[[int, int], Step]
"""Returns a step, given rank and number of processes; must be picklable."""

_STATUS = Path("/proc/self/status")
_PATIENCE_S = 600.0
"""Longest wait for an answer of a process (s); chosen: far longer than any step."""


class Team(contextlib.AbstractContextManager["Team"]):
    """Processes that share each batch.

    Between the steps they sleep, so that several teams can exist at the same time.

    Args:
        make_step: builds the step in each process.
        processes: how many.
        threads: of torch in each.
    """

    def __init__(self, make_step: MakeStep, processes: int, threads: int) -> None:
        self._folder = TemporaryDirectory()
        context = multiprocessing.get_context("spawn")
        store = str(Path(self._folder.name, "store"))
        self._ends: list[Connection] = []
        self._members = []
        for rank in range(processes):
            mine, theirs = context.Pipe()
            member = context.Process(
                target=_work,
                args=(theirs, make_step, rank, processes, threads, store),
                daemon=True,
            )
            member.start()
            theirs.close()
            self._ends.append(mine)
            self._members.append(member)
        self._answers()  # ready

    def step(self) -> tuple[float, float]:
        """Do one step in all processes; return its time (s) and the loss of the whole batch."""
        begin = time.perf_counter()
        losses = self._ask("step")
        return time.perf_counter() - begin, sum(losses)

    def growth_mb(self) -> float:
        """Return the growth of the largest resident memory during the steps, summed (MB)."""
        return sum(self._ask("memory"))

    def _ask(self, what: str) -> list[float]:
        for end in self._ends:
            end.send(what)
        return self._answers()

    def _answers(self) -> list[float]:
        found = []
        for end in self._ends:
            try:
                answer = end.recv() if end.poll(_PATIENCE_S) else "no answer in time"
            except EOFError:
                answer = "a process ended"
            if isinstance(answer, str):
                raise ConfigurationError(f"the training benchmark failed: {answer}")
            found.append(answer)
        return found

    def __exit__(self, *_: object) -> None:
        for member in self._members:
            member.terminate()
            member.join()
        self._folder.cleanup()


def sum_gradients(model: nn.Module) -> None:
    """Replace each gradient by its sum over the processes; a missing one stays missing."""
    grads = [p.grad for p in model.parameters() if p.grad is not None]
    flat = torch.cat([g.flatten() for g in grads])
    torch.distributed.all_reduce(flat)
    parts = flat.split([g.numel() for g in grads])
    for grad, total in zip(grads, parts, strict=True):
        grad.copy_(total.view_as(grad))


def memory_mb(name: str) -> float:
    """Return this process's resident memory, present (``VmRSS``) or largest (``VmHWM``) (MB)."""
    # getrusage's maximum is the fallback only: a process inherits it from its parent.
    if _STATUS.is_file():
        for line in _STATUS.read_text(encoding="ascii").splitlines():
            if line.startswith(f"{name}:"):
                return float(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _work(
    end: Connection, make_step: MakeStep, rank: int, processes: int, threads: int, store: str
) -> None:
    """Answer the commands of the team until the process is terminated."""
    try:
        prepare_process(threads)
        if processes > 1:
            torch.distributed.init_process_group(
                "gloo", init_method=f"file://{store}", rank=rank, world_size=processes
            )
        step = make_step(rank, processes)
        before = memory_mb("VmRSS")
        end.send(0.0)
        while True:
            what = end.recv()
            end.send(step() if what == "step" else memory_mb("VmHWM") - before)
    except EOFError:
        pass
    except Exception as error:
        end.send(f"{type(error).__name__}: {error}")
