# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checks what a checkpoint holds, before anything else uses it.

A checkpoint may have been edited, written by another program or by another version. What uses it
can then rely on the names and kinds of its values; that weights fit a network, and values a
configuration, shows where these are built.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch

KINDS = {dict: "a mapping", list: "a list", int: "a whole number", float: "a number", str: "text"}
"""Kind of a value -> its name in errors."""

REQUIRED: dict[str, type] = {
    "config": dict,
    "model_config": dict,
    "average": dict,
    "epoch": int,
    "step": int,
    "metrics": dict,
    "splits": list,
}
"""What every checkpoint has, see :func:`mtpgo_training.training.checkpointing.save_checkpoint`."""

OPTIONAL: dict[str, type] = {
    "network": str,
    "calibration": dict,
    "covariance_scale": float,
    "adapted_from": dict,
    "model": dict,
    "optimiser": dict,
    "precision": dict,
    "state": dict,
}
"""What some have: those of a training, of a shipped model, or of an earlier version."""


def check_content(content: Mapping[str, Any], refused: Callable[[str], Exception]) -> None:
    """Check names and kinds of a checkpoint's values, and that its weights are numbers.

    Args:
        content: of the checkpoint.
        refused: makes the error of a reason that follows ``it``.

    Raises:
        Exception: that of ``refused``.
    """
    for name, kind in REQUIRED.items():
        if name not in content:
            raise refused(f"has no {name!r}")
        _check_kind(name, content[name], kind, refused)
    for name, kind in OPTIONAL.items():
        if name in content:
            _check_kind(name, content[name], kind, refused)
    for name in ("average", "model"):
        _check_weights(name, content.get(name, {}), refused)
    for number, entry in enumerate(content["splits"]):
        _check_kind(f"splits[{number}]", entry, dict, refused)
        for key in ("name", "sha256", "split"):
            _check_kind(f"splits[{number}].{key}", entry.get(key), str, refused)
    for model, protocols in content["metrics"].items():
        _check_kind(f"metrics.{model}", protocols, dict, refused)
        for protocol, scores in protocols.items():
            _check_kind(f"metrics.{model}.{protocol}", scores, dict, refused)
            for score, value in scores.items():
                if value is not None:
                    _check_kind(f"metrics.{model}.{protocol}.{score}", value, float, refused)


def _check_kind(name: str, value: Any, kind: type, refused: Callable[[str], Exception]) -> None:
    kinds = (int, float) if kind is float else kind
    if isinstance(value, bool) or not isinstance(value, kinds):
        raise refused(f"has {_short(value)} as {name!r}, expected {KINDS[kind]}")


def _check_weights(
    part: str, weights: Mapping[str, Any], refused: Callable[[str], Exception]
) -> None:
    for name, value in weights.items():
        if not isinstance(value, torch.Tensor):
            raise refused(f"has {_short(value)} as {part!r}.{name}, expected a tensor")
        if not bool(torch.isfinite(value).all()):
            raise refused(f"has values in {part!r}.{name} that are not finite numbers")


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 40 else f"{text[:40]}..."
