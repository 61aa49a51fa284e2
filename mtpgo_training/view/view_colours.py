# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours of road users in animations and in rerun: those of the page in its light form."""

from __future__ import annotations

from mtpgo_core.schema import AgentClass

CLASS_COLOURS = {
    AgentClass.CAR: "#1f6fd1",
    AgentClass.VAN: "#2a9cc4",
    AgentClass.TRUCK: "#d9730d",
    AgentClass.BUS: "#8a4fc9",
    AgentClass.TRAILER: "#b5651d",
    AgentClass.MOTORCYCLE: "#0f9d8c",
    AgentClass.BICYCLE: "#3d9a3d",
    AgentClass.PEDESTRIAN: "#d6336c",
    AgentClass.ANIMAL: "#8d6e3f",
    AgentClass.UNKNOWN: "#68737d",
}

FALLBACK_COLOUR = "#7b858e"
"""Of predictions at constant velocity."""


def colour_bytes(colour: str) -> list[int]:
    """Return red, green and blue (0 to 255) of a colour written as ``#rrggbb``."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
