# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The parts of a network that a training changes."""

from __future__ import annotations

from collections.abc import Sequence

from torch import nn

from mtpgo_core.errors import ConfigurationError

CALIBRATED_PARTS = ("noise", "initial_covariance")
"""Parts of the networks that give their covariances: MTP-GO has both, baselines and ablations the
first. Weights trained on which mode is nearest made the heaviest mode's ADE 7 % larger (measured);
they get a temperature when the model is exported."""


def calibrated_parts(model: nn.Module) -> list[str]:
    """Return those of :data:`CALIBRATED_PARTS` that a network has."""
    parts = {name.partition(".")[0] for name, _ in model.named_parameters()}
    return [part for part in CALIBRATED_PARTS if part in parts]


def train_only(model: nn.Module, parts: Sequence[str]) -> None:
    """Exclude all parameters from the training whose names have none of the prefixes.

    Args:
        model: the network; its parameters are changed.
        parts: the prefixes; with none, nothing changes.

    Raises:
        ConfigurationError: no parameter has a prefix.
    """
    names = [name for name, _ in model.named_parameters()]
    for part in parts:
        if not any(_is_of(name, part) for name in names):
            known = sorted({name.partition(".")[0] for name in names})
            raise ConfigurationError(
                f"optimisation.train_only names {part!r}, expected parts of the network: "
                + ", ".join(known)
            )
    for name, parameter in model.named_parameters() if parts else ():
        parameter.requires_grad_(any(_is_of(name, part) for part in parts))


def _is_of(name: str, part: str) -> bool:
    return name == part or name.startswith(f"{part}.")
