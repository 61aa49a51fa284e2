# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What drawings of road users share: colours, sizes where none is known, which modes are drawn."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import AgentClass, BoolArray, ClassArray, Float64Array

CLASS_COLOURS = {
    AgentClass.CAR: "#1f6fd1",
    AgentClass.VAN: "#56b4e9",
    AgentClass.TRUCK: "#d9730d",
    AgentClass.BUS: "#4b1f82",
    AgentClass.TRAILER: "#6b3a12",
    AgentClass.MOTORCYCLE: "#00695c",
    AgentClass.BICYCLE: "#8cc81e",
    AgentClass.PEDESTRIAN: "#e0246b",
    AgentClass.ANIMAL: "#b8a04a",
    AgentClass.UNKNOWN: "#2f353b",
}
"""Colour of each class in pictures, animations and rerun: that of the page in its light form."""

SHOWN_WEIGHT = 0.05
"""Modes below this weight are not drawn; chosen."""

DEFAULT_SIZE_M = {AgentClass.PEDESTRIAN: (0.6, 0.6), AgentClass.BICYCLE: (1.8, 0.7)}
CAR_SIZE_M = (4.6, 1.9)
"""Length and width drawn for a road user without a size, by class and for all other classes (m);
chosen."""


def drawn_sizes(size: Float64Array, agent_class: ClassArray) -> Float64Array:
    """Return [n, 2] length and width (m), by class where ``size`` [n, 2] is not known."""
    kinds = map(AgentClass, agent_class.tolist())
    usual = np.array([DEFAULT_SIZE_M.get(kind, CAR_SIZE_M) for kind in kinds]).reshape(-1, 2)
    return np.where(np.isfinite(size) & (size > 0.0), size, usual)


def shown_modes(weight: Float64Array) -> BoolArray:
    """[..., M] modes that are drawn: the heaviest and those from SHOWN_WEIGHT on."""
    return np.asarray((weight >= SHOWN_WEIGHT) | (weight == weight.max(axis=-1, keepdims=True)))
