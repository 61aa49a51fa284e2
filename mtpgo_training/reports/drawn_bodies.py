# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What drawings of road users share: colours, and which modes are drawn."""

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


def class_colours(agent_class: ClassArray) -> list[str]:
    """Return the colours of classes [n]; a number that no class has is drawn as unknown."""
    return [CLASS_COLOURS[AgentClass.from_code(code)] for code in agent_class.tolist()]


def shown_modes(weight: Float64Array) -> BoolArray:
    """[..., M] modes that are drawn: the heaviest and those from SHOWN_WEIGHT on."""
    return np.asarray((weight >= SHOWN_WEIGHT) | (weight == weight.max(axis=-1, keepdims=True)))
