# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours in animations and in rerun besides those of classes: the page's in its light form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array

GROUND, ROAD, LANE, TEXT = "#f4f5f3", "#e6e8e8", "#b9bfc5", "#1c2126"

FALLBACK_COLOUR = "#7b858e"
"""Of predictions at constant velocity."""


def colour_bytes(colour: str) -> list[int]:
    """Return red, green and blue (0 to 255) of a colour written as ``#rrggbb``."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]


def faded(colours: NDArray[np.integer], share: float | Float64Array) -> NDArray[np.uint8]:
    """Return colours as if seen through over the ground, for what is drawn without transparency.

    Args:
        colours: [k, 3] red, green and blue (0 to 255).
        share: of the colour, the rest is the ground's; [k] or one for all.
    """
    ground = np.array(colour_bytes(GROUND))
    part = np.broadcast_to(share, len(colours))[:, None]
    return np.rint(ground + part * (colours - ground)).astype(np.uint8)
