# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What drawings of road users share: sizes where none is known, and which modes are drawn."""

from __future__ import annotations

from mtpgo_core.schema import AgentClass

SHOWN_WEIGHT = 0.05
"""Modes below this weight are not drawn; chosen."""

DEFAULT_SIZE_M = {AgentClass.PEDESTRIAN: (0.6, 0.6), AgentClass.BICYCLE: (1.8, 0.7)}
CAR_SIZE_M = (4.6, 1.9)
"""Length and width drawn for a road user without a size, by class and for all other classes (m);
chosen."""
