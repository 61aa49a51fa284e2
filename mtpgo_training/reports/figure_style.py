# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What all figures of a report have in common: style, axes, lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mtpgo_training.reports.series import BASELINE_DASHES, DASHES, colour

Json = dict[str, Any]

INK, GRID = "#2b3036", "#e3e5e7"

STYLE: Any = {
    "font.size": 10,
    "font.family": "DejaVu Sans",
    "axes.edgecolor": "#b9bdc1",
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "text.color": INK,
    "xtick.color": "#5d6872",
    "ytick.color": "#5d6872",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


def new_axes(width_in: float = 5.6, height_in: float = 3.9) -> tuple[Figure, Any]:
    """Return a figure of a size (inches) and its axes."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    return figure, figure.add_subplot()


def line_style(content: Json, name: str) -> dict[str, Any]:
    """Return the arguments of a line of a model or baseline."""
    baseline = name in content["baselines"]
    return {
        "color": colour(content, name),
        "lw": 1.4 if baseline else 2.2,
        "ls": BASELINE_DASHES.get(name, DASHES) if baseline else "-",
        "label": name,
        "zorder": 3 if baseline else 4,
    }


def numbers(values: Sequence[float | None]) -> np.ndarray:
    """Return values as an array, NaN for None."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)
