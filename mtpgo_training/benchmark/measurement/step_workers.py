# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that do training steps when told to, so that two ways of training can take turns."""

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
"""One step on a process's share of the batch; returns its part of the batch's loss."""

MakeStep = Callable[[int, int], Step]
"""From a process's number and their count; a function or partial that can be pickled."""

_STATUS = Path("/proc/self/status")
_PATIENCE_S = 600.0


class Team(contextlib.AbstractContextManager["Team"]):
    """Processes that share each batch.

    Between the steps they sleep, so several teams can exist at the same time.

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
        """One step of all: its time (s) and the whole batch's loss."""
        begin = time.perf_counter()
        losses = self._ask("step")
        return time.perf_counter() - begin, sum(losses)

    def growth_mb(self) -> float:
        """By how much the steps raised the processes' largest resident memory, summed (MB)."""
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
    """Replace each gradient by its sum over the processes; one without stays without."""
    grads = [p.grad for p in model.parameters() if p.grad is not None]
    flat = torch.cat([g.flatten() for g in grads])
    torch.distributed.all_reduce(flat)
    parts = flat.split([g.numel() for g in grads])
    for grad, total in zip(grads, parts, strict=True):
        grad.copy_(total.view_as(grad))


def memory_mb(name: str) -> float:
    """``VmRSS`` (now) or ``VmHWM`` (largest) of this process (MB)."""
    # getrusage's maximum is no use where this exists: a process takes it over from its parent.
    if _STATUS.is_file():
        for line in _STATUS.read_text(encoding="ascii").splitlines():
            if line.startswith(f"{name}:"):
                return float(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _work(
    end: Connection, make_step: MakeStep, rank: int, processes: int, threads: int, store: str
) -> None:
    """What a process of a team does until it is ended."""
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
