# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours in animations and in rerun besides those of the classes."""

from __future__ import annotations

FALLBACK_COLOUR = "#7b858e"
"""Of predictions at constant velocity."""


def colour_bytes(colour: str) -> list[int]:
    """Return red, green and blue (0 to 255) of a colour written as ``#rrggbb``."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
