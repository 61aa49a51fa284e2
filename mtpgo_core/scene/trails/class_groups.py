# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Groups of road user classes that use the same paths, and the constants of their trails.

They differ from the groups of the calibration: a motorcycle rides where cars do, a bicycle often
does not, and an animal walks where pedestrians do.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import AgentClass, BoolArray, ClassArray, Float64Array

UNKNOWN, MOTOR, BICYCLE, PEDESTRIAN = range(4)

_GROUP = np.full(256, UNKNOWN, dtype=np.uint8)
_GROUP[
    [
        AgentClass.CAR,
        AgentClass.TRUCK,
        AgentClass.BUS,
        AgentClass.TRAILER,
        AgentClass.MOTORCYCLE,
        AgentClass.VAN,
    ]
] = MOTOR
_GROUP[AgentClass.BICYCLE] = BICYCLE
_GROUP[[AgentClass.PEDESTRIAN, AgentClass.ANIMAL]] = PEDESTRIAN

_SPACING_M = np.array([1.0, 2.0, 1.0, 0.5])
"""Distance between the points of a trail by group (m); chosen: a twentieth of a usual turn."""
_FLOOR_MPS = np.array([1.0, 4.0, 4.0, 1.0])
"""Speeds by group (m/s) at which the way of a slower agent is looked at; chosen: of an agent that
stands, it shows where its way leads. Unknown agents may be pedestrians."""


def class_groups(agent_class: ClassArray) -> ClassArray:
    """Return [n] the groups of classes [n]."""
    return _GROUP[agent_class]


def join(one: ClassArray, other: ClassArray) -> BoolArray:
    """Return whether two groups use each other's trails: equal groups, or either unknown."""
    return (one == other) | (one == UNKNOWN) | (other == UNKNOWN)


def spacing_m(group: ClassArray) -> Float64Array:
    """Return the distance between the points of a trail (m)."""
    return _SPACING_M[group]


def floor_mps(group: ClassArray) -> Float64Array:
    """Return the speeds with which the trails ahead of slower agents are sampled (m/s)."""
    return _FLOOR_MPS[group]
