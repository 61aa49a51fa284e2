# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Groups of road user classes that move alike, for results by group."""

from __future__ import annotations

from mtpgo_core.schema import AgentClass

CLASS_GROUPS = ("vehicles", "bicycles", "pedestrians", "animals", "unknown")
"""Names of the groups; motorcycles are vehicles."""

_OTHERS = {
    AgentClass.BICYCLE: "bicycles",
    AgentClass.PEDESTRIAN: "pedestrians",
    AgentClass.ANIMAL: "animals",
    AgentClass.UNKNOWN: "unknown",
}


def class_group(agent_class: int) -> str:
    """Return the group of a class."""
    return _OTHERS.get(AgentClass(agent_class), "vehicles")
