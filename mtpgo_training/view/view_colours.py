# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours of road users in animations and in rerun: those of the page in its light form."""

from __future__ import annotations

from mtpgo_core.schema import AgentClass

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

FALLBACK_COLOUR = "#7b858e"
"""Of predictions at constant velocity."""


def colour_bytes(colour: str) -> list[int]:
    """Return red, green and blue (0 to 255) of a colour written as ``#rrggbb``."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
