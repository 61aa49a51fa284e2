# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The check of a loaded TorchScript module before it runs: its operators, loops and weights."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import torch

from mtpgo_core.task.model_operators import OPERATORS

MOST_REPETITIONS = 1_000_000
"""Largest constant number of repetitions of a loop; chosen: the shipped models repeat what they do
for each step of the horizon, 25 times, or once for each agent."""

MOST_NODES = 1_000_000
"""Most operators of a module, calls expanded; chosen: the shipped model has 6,000."""


_NESTED = {"prim::Loop", "prim::If", "prim::With"}
"""Operators that contain others; a foreign one that does is refused itself."""


def faults(module: torch.jit.ScriptModule) -> Iterator[str]:
    """Yield what a module does that a model may not do, as the end of a sentence.

    The graph is that of ``forward`` with all functions and submodules expanded, as torch runs it.
    Its constants are weights, too, since freezing makes constants of parameters and buffers.
    """
    for name, value in itertools.chain(module.named_parameters(), module.named_buffers()):
        yield from _weight_faults(name, value)
    for count, node in enumerate(_nodes(module.inlined_graph)):
        if count == MOST_NODES:
            yield f"has more than {MOST_NODES} operators"
            return
        kind = node.kind()
        if kind not in OPERATORS:
            yield (
                f"uses the operator {kind}, which no model needs, expected operators on tensors"
                " only (SECURITY.md lists them)"
            )
        elif kind == "prim::Loop":
            yield from _loop_faults(node)
        elif kind == "prim::Constant":
            value = node.output().toIValue()
            if isinstance(value, torch.Tensor):
                yield from _weight_faults(node.output().debugName(), value)


def _weight_faults(name: str, value: torch.Tensor) -> Iterator[str]:
    if value.is_floating_point() and not bool(torch.isfinite(value).all()):
        yield f"has weights that are not finite numbers ({name})"


def _nodes(block: Any) -> Iterator[Any]:
    waiting = [block]
    while waiting:
        for node in waiting.pop().nodes():
            yield node
            if node.kind() in _NESTED:
                waiting.extend(node.blocks())


def _loop_faults(node: Any) -> Iterator[str]:
    """Yield why a loop may not end.

    A loop that ends after a number of repetitions known at its start has conditions that are
    constants. That number comes from the shapes of the input, since no allowed operator turns data
    into a whole number.
    """
    count, condition = list(node.inputs())[:2]
    (body,) = node.blocks()
    again = next(iter(body.outputs()))
    if not all(_constant(value) is True for value in (condition, again)):
        yield (
            "has a loop that ends by a condition, expected loops of a number of repetitions that"
            " is known at their start"
        )
    repetitions = _constant(count)
    if repetitions is not None and repetitions > MOST_REPETITIONS:
        yield f"has a loop of {repetitions} repetitions, expected at most {MOST_REPETITIONS}"


def _constant(value: Any) -> Any:
    """Return the value of a constant, None if it is none."""
    return value.toIValue() if value.node().kind() == "prim::Constant" else None
